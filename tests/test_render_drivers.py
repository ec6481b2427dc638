"""Another driver makes the same picture: what may differ between GL implementations, measured and bounded.

    D = |image of driver A - image of driver B|,     mean D <= 0.5 %, 99.5th percentile <= 8 % of full scale

after a 3 x 3 average, about the tolerance of golden images (edges of shadows differ most); and labels that
differ in a few pixels along edges alone. The second driver is Mesa's softpipe, an implementation of
rasterisation, interpolation and texture filters apart from llvmpipe's and from every GPU's. Within llvmpipe
the width of the processor's vectors changes no bit.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import uniform_filter

from golden_images import MEAN_TOLERANCE, PEAK_TOLERANCE, encoded

SOFTPIPE = {
    "GALLIUM_DRIVER": "softpipe",
    "LIBGL_ALWAYS_SOFTWARE": "1",
    "MESA_GL_VERSION_OVERRIDE": "4.5",  # it does all that the shaders need, and promises 3.3
    "MESA_GLSL_VERSION_OVERRIDE": "450",
}
NARROW = {"GALLIUM_DRIVER": "llvmpipe", "LIBGL_ALWAYS_SOFTWARE": "1", "LP_NATIVE_VECTOR_WIDTH": "128"}
USUAL = {"GALLIUM_DRIVER": "llvmpipe", "LIBGL_ALWAYS_SOFTWARE": "1"}
LABELS = ("albedo", "normal", "depth", "object_id")

SCRIPT = """
import sys
import numpy as np
from fsid.render import Renderer
from fsid.scene import SceneConfig, sample

with Renderer(texture_size=64) as renderer:
    print(renderer.info.renderer)
    for seed in (1, 2):
        scene = sample(SceneConfig(objects=(4, 6)), seed, width=96, height=64)
        frame = renderer.render(scene)
        names = ("radiance", "albedo", "normal", "depth", "object_id")
        np.savez(f"{sys.argv[1]}/{seed}.npz", **{name: getattr(frame, name) for name in names})
"""


@dataclass(frozen=True)
class Rendered:
    """What a driver made of the two scenes, by the name of the array, (2, H, W, ...)."""

    driver: str
    arrays: dict[str, np.ndarray]


def rendered(folder: Path, environment: dict[str, str]) -> Rendered:
    folder.mkdir()
    run = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(folder)],
        env=os.environ | environment,
        capture_output=True,
        text=True,
    )
    if run.returncode:
        pytest.skip(f"no driver for {environment['GALLIUM_DRIVER']} here: {run.stderr.splitlines()[-1]}")
    frames = [np.load(folder / f"{seed}.npz") for seed in (1, 2)]
    driver = run.stdout.splitlines()[0]
    if environment["GALLIUM_DRIVER"] not in driver:
        pytest.skip(f"asked for {environment['GALLIUM_DRIVER']}, got {driver}")
    return Rendered(driver, {name: np.stack([frame[name] for frame in frames]) for name in frames[0].files})


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> Rendered:
    return rendered(tmp_path_factory.mktemp("drivers") / "usual", USUAL)


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Rendered:
    return rendered(tmp_path_factory.mktemp("drivers") / "other", SOFTPIPE)


def test_pictures_agree(usual: Rendered, other: Rendered) -> None:
    for one, two in zip(usual.arrays["radiance"], other.arrays["radiance"], strict=True):
        exposure = 0.18 / np.median(one)
        difference = np.abs(encoded(one, exposure) - encoded(two, exposure))
        smooth = uniform_filter(difference, (3, 3, 0))
        assert 0 < smooth.mean() < MEAN_TOLERANCE
        assert np.quantile(smooth, 0.995) < PEAK_TOLERANCE
        assert abs(two.mean() / one.mean() - 1) < 0.005


def test_labels_agree_but_along_edges(usual: Rendered, other: Rendered) -> None:
    first, second = usual.arrays, other.arrays
    same = first["object_id"] == second["object_id"]
    assert (~same).mean() < 0.003
    for name in ("albedo", "normal"):
        assert np.abs(first[name] - second[name]).mean() < 0.003
    seen = same & np.isfinite(first["depth"]) & np.isfinite(second["depth"])
    off = np.abs(first["depth"][seen] / second["depth"][seen] - 1)
    assert (off > 1e-4).mean() < 0.003


def test_the_width_of_vectors_changes_nothing(usual: Rendered, tmp_path: Path) -> None:
    narrow = rendered(tmp_path / "narrow", NARROW)
    assert "128 bits" in narrow.driver
    for name in ("radiance", *LABELS):
        np.testing.assert_array_equal(narrow.arrays[name], usual.arrays[name])
