"""What is left out because it cannot be seen changes no bit; what is interpolated stays within its bound."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fsid.render import Frame, Renderer
from fsid.scene import Scene, SceneConfig, sample
from fsid.scene.model import Distortion, Light, Material

CONFIG = SceneConfig(objects=(6, 9))


def scene(seed: int, width: int = 96) -> Scene:
    """Sampled, with every kind of lamp and some glass."""
    drawn = sample(CONFIG, seed, width=width, height=width // 2)
    lamps = (
        Light("point", (0.6, -0.4, 1.2), (0.0, 0.0, -1.0), (1.0, 0.9, 0.8), 0.05, 360.0),
        Light("spot", (-0.7, 0.5, 1.4), (0.5, -0.3, -1.0), (2.0, 2.0, 2.0), 0.02, 60.0),
        Light("area", (0.1, 0.8, 1.1), (0.0, -0.5, -1.0), (2.0, 2.0, 2.0), 0.0, 360.0, (0.4, 0.3)),
    )
    glass = tuple(tuple(_clear(m) if i == 1 else m for m in ms) for i, ms in enumerate(drawn.materials))
    return replace(drawn, lights=(*drawn.lights, *lamps), materials=glass)


def _clear(material: Material) -> Material:
    return replace(material, transmission=1.0, translucency=0.0)


def same(a: Frame, b: Frame) -> bool:
    return all(
        np.array_equal(getattr(a, name), getattr(b, name))
        for name in ("radiance", "albedo", "normal", "depth")
    )


@pytest.mark.parametrize("seed", [1, 4])
def test_tiles_that_nobody_sees_are_left_out(
    renderer: Renderer, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    import fsid.render.shadow_pass as module

    what = scene(seed)
    answers: list[bool] = []
    sees = module.sees

    def counting(*arguments):
        answers.append(sees(*arguments))
        return answers[-1]

    monkeypatch.setattr(module, "sees", counting)
    less = renderer.render(what)
    assert {False, True} == set(answers)
    monkeypatch.setattr(module, "sees", lambda *rest: True)
    assert same(less, renderer.render(what))


BENT = Distortion("brown-conrady", (-0.12, 0.02, 0.001, -0.001, 0.0))
EVERYWHERE = "#version 430 core\nvoid main() { gl_FragDepth = 0.0; }\n"


@pytest.mark.parametrize("lens", [None, BENT])
def test_glass_is_drawn_only_where_there_is_some(
    renderer: Renderer, lens: Distortion | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    import fsid.render.programs as module

    what = scene(1)
    what = replace(what, cameras=(replace(what.cameras[0], distortion=lens),))
    less, source = renderer.render(what), module._source
    monkeypatch.setattr(renderer._shade, "_programs", {})
    monkeypatch.setattr(
        module, "_source", lambda name: EVERYWHERE if name == "glass_marks.frag" else source(name)
    )
    assert same(less, renderer.render(what))
    monkeypatch.setattr(renderer._shade, "draw_glass", lambda *rest: None)
    assert not same(less, renderer.render(what))


def test_a_bent_lens_sees_its_tiles_too(renderer: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    import fsid.render.shadow_pass as module

    what = scene(4)
    what = replace(what, cameras=(replace(what.cameras[0], distortion=BENT),))
    less = renderer.render(what)
    monkeypatch.setattr(module, "sees", lambda *rest: True)
    assert same(less, renderer.render(what))


@pytest.mark.parametrize("seed", [1, 4])
def test_interpolated_shadows_are_those_of_every_pixel(
    renderer: Renderer, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Mean difference below 5e-4 of the median radiance, 99.9th percentile below 2 %."""
    what = scene(seed, width=320)
    fast = renderer.render(what).radiance
    begin = type(renderer._targets).begin_shadow_blocks
    monkeypatch.setattr(type(renderer._targets), "begin_shadow_blocks", lambda self, lights: begin(self, 0))
    exact = renderer.render(what).radiance
    difference = np.abs(fast - exact).mean(-1) / np.median(exact)
    assert difference.max() > 0
    assert difference.mean() < 5e-4
    assert np.quantile(difference, 0.999) < 0.02
