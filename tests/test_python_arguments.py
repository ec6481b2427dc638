"""What scripts and notebooks give by mistake is refused in one line; what means the same is taken."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import fsid
from fsid.assets import build_mesh
from fsid.dataset import (
    GenerateConfig,
    contact_sheet,
    generate,
    make_sample,
    save_png,
)
from fsid.errors import FsidError
from fsid.evaluate import (
    NOISY,
    compare,
    denoise_classical,
    photo_testset,
    simulated_testset,
)
from fsid.render import Renderer
from fsid.scene import SceneConfig, sample
from fsid.sensor import (
    NoiseLevel,
    NoiseTerms,
    Raw,
    add_noise,
    add_noise_terms,
    clean_from_frame,
    clean_from_linear,
    clean_from_photo,
    develop_linear,
    load_profile,
    noisy_from_clean,
    raw_from_dn,
)
from fsid.sensor.colour import colour_rand
from fsid.sensor.exposure import expose

LIGHT = np.full((8, 8, 3), 0.5, np.float32)
PIXEL6 = load_profile("pixel6")
ANY: Any = None


def raw() -> Raw:
    dn = np.full((8, 8), 200, np.uint16)
    return raw_from_dn(dn, cfa="RGGB", black_level=64, white_level=1023, iso=800)


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def simulated(**settings: Any) -> object:
    return simulated_testset("testset", camera="pixel6", **settings)


MISTAKES: dict[str, tuple[Callable[[], object], str]] = {
    "a path for a RAW": (lambda: fsid.develop("x.dng"), "a str is no Raw: read_raw reads one"),
    "an array for a RAW": (lambda: develop_linear(LIGHT), "a ndarray is no Raw: read_raw reads one"),
    "the RAW first": (lambda: fsid.write_dng(raw(), "x.dng"), "a str is no Raw: read_raw reads one"),
    "bytes for a file": (lambda: fsid.read_raw(b"II*"), r"a bytes is no RAW file: .*io.BytesIO"),
    "a text file": (lambda: fsid.read_raw(io.StringIO("II*")), "a StringIO is no RAW file"),
    "an ISO in words": (lambda: replace(raw(), iso="800"), "iso '800': must be a number"),
    "an ISO of None": (lambda: replace(raw(), iso=None), "iso None: must be a number, 0 where"),
    "a seed for a generator": (
        lambda: noisy_from_clean(0, raw(), 800, PIXEL6.level(800)),
        r"a int is no Generator: numpy.random.default_rng\(seed\) makes one",
    ),
    "a profile for a level": (
        lambda: noisy_from_clean(rng(), raw(), 800, PIXEL6),
        r"a CameraProfile is no NoiseLevel: .*level\(iso\)",
    ),
    "the name of a profile": (
        lambda: clean_from_linear(rng(), LIGHT, "pixel6"),
        "a str is no CameraProfile: load_profile",
    ),
    "that of a photograph": (
        lambda: clean_from_photo(rng(), LIGHT, "pixel6"),
        "a str is no CameraProfile",
    ),
    "a seed for terms": (
        lambda: add_noise_terms(7, raw(), PIXEL6.level(800), NoiseTerms()),
        "a int is no Gen",
    ),
    "a seed for an exposure": (lambda: expose(7, LIGHT), "a int is no Generator"),
    "a seed for a colour": (lambda: colour_rand(7, np.eye(3)[None]), "a int is no Generator"),
    "two numbers for a level": (
        lambda: add_noise(rng(), raw(), (1e-3, 1e-5)),
        "a tuple is no NoiseLevel",
    ),
    "a Pillow image for a photograph": (
        lambda: clean_from_photo(rng(), Image.new("RGB", (8, 8)), PIXEL6),
        "a photo: a Image is no array",
    ),
    "a list for a picture": (lambda: save_png("a.png", [[[0.5]]]), "a picture: a list is no array"),
    "a photograph of nothing": (
        lambda: clean_from_photo(rng(), LIGHT[:0], PIXEL6),
        r"must have shape .* got \(0, 8, 3\)",
    ),
    "a seed below 0": (lambda: build_mesh("mug", -1), "seed -1: must not be negative"),
    "a profile for the classical denoiser": (
        lambda: denoise_classical(raw(), PIXEL6),
        "a CameraProfile is no NoiseLevel",
    ),
    "a level in DN": (
        lambda: denoise_classical(raw(), NoiseLevel((2.0,) * 4, (3.0,) * 4)),
        "units of the white level",
    ),
    "NaN for a pixel": (
        lambda: denoise_classical(replace(raw(), mosaic=np.full((8, 8), np.nan)), PIXEL6.level(800)),
        "holds NaN or infinity",
    ),
    "a seed for a frame": (lambda: clean_from_frame(None, ANY, PIXEL6), "a NoneType is no Generator"),
    "half a width": (lambda: sample(SceneConfig(), 0, width=128 / 2), "width: 64.0 is not a whole number"),
    "a dict for settings of scenes": (lambda: sample({"objects": (2, 3)}, 0), "a dict is no SceneConfig"),
    "a name for settings": (
        lambda: make_sample("fsid-175k", 0, 0, None),
        "a str is no GenerateConfig: generate_config",
    ),
    "an index of 1e3": (lambda: make_sample(GenerateConfig(), 0, 1e3, None), "index: 1000.0 is not a whole"),
    "a seed of None": (lambda: make_sample(GenerateConfig(), ANY, 0, None), "seed: None is not a whole"),
    "a count of 1e3": (lambda: generate("data", GenerateConfig(), count=1e3), "count: 1000.0 is not a whole"),
    "a dict for settings": (lambda: generate("data", {"width": 64}, count=1), "a dict is no GenerateConfig"),
    "a sheet of 4.0": (lambda: contact_sheet(GenerateConfig(), 0, 4.0), "count: 4.0 is not a whole number"),
    "no renderer": (lambda: make_sample(GenerateConfig(), 0, 0, None), "a renderer is needed"),
    "1.5 samples": (lambda: Renderer(supersampling=1.5), "supersampling: 1.5 is not a whole number"),
    "texels of 1e3": (lambda: Renderer(texture_size=1e3), "texture_size: 1000.0 is not a whole number"),
    "half an image": (lambda: Renderer(lens_images=1.5), "lens_images: 1.5 is not a whole number"),
    "one ISO": (
        lambda: photo_testset("photos", "set", camera="pixel6", isos=3200),
        r"isos: 3200 .*give \[3200\]",
    ),
    "one light level": (lambda: simulated(luxes=0.5), r"luxes: 0.5 is not a list; give \[0.5\]"),
    "one material": (
        lambda: simulated(materials="text"),
        r"materials: 'text' is not a list; give \['text'\]",
    ),
    "1.0 scenes": (lambda: simulated(scenes=1.0), "scenes: 1.0 is not a whole number"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named_in_one_line(mistake: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    call, words = MISTAKES[mistake]
    with pytest.raises(FsidError, match=words) as refusal:
        call()
    assert "\n" not in str(refusal.value)
    assert not list(tmp_path.iterdir())


def test_what_networks_and_trainings_are_not_is_named(tmp_path: Path):
    pytest.importorskip("torch")
    from fsid.denoise import denoise_raw, train

    with pytest.raises(FsidError, match="a dict is no TrainConfig: train_config"):
        train(tmp_path, tmp_path / "run", {"steps": 2})
    with pytest.raises(FsidError, match="a str is no network"):
        denoise_raw(raw(), "run", PIXEL6.level(800))
    (tmp_path / "photos").mkdir()
    save_png(tmp_path / "photos" / "a.png", np.full((64, 64, 3), 0.5))
    photo_testset(tmp_path / "photos", tmp_path / "set", camera="pixel6", isos=[3200])
    with pytest.raises(FsidError, match="crop_levels: 'iso3200' is not a list"):
        compare(tmp_path / "set", [NOISY], crop_levels="iso3200")
