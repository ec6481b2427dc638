"""Sample i = f(config, seed, i): one clean RAW, one noisy RAW, and the record of how they came about.

    scene or photograph -> clean Raw -> noisy Raw

The two random streams of a sample (scene, sensor) are spawned from SeedSequence(seed, spawn_key=(i,)), so a
sample does not depend on which process makes it, in which order, or how many others there are.
"""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from PIL import Image

from fsid import __version__
from fsid.config import to_plain
from fsid.dataset.config import GenerateConfig
from fsid.dataset.photos import crop_rand, find_photos, read_photo
from fsid.render import Frame
from fsid.scene import Scene
from fsid.scene import sample as sample_scene
from fsid.sensor import (
    Raw,
    clean_from_frame,
    clean_from_photo,
    clean_levels,
    develop,
    level_rand,
    load_profile,
    noisy_from_clean,
    write_dng,
)


class SceneRenderer(Protocol):
    """Anything that turns a scene into a frame."""

    def render(self, scene: Scene, camera_index: int = 0) -> Frame: ...


@dataclass(frozen=True)
class Sample:
    """A pair and its record. `record` is plain data (JSON)."""

    key: str
    clean: Raw
    noisy: Raw
    record: dict[str, Any]


def sample_key(index: int) -> str:
    """The name of sample `index` inside the shards."""
    return f"{index:08d}"


def scene_of(config: GenerateConfig, seed: int, index: int) -> Scene:
    """The scene of sample `index`."""
    scene_stream, _ = _streams(seed, index)
    scene_seed = int(scene_stream.generate_state(1, np.uint64)[0] >> np.uint64(1))
    return sample_scene(
        config.scene, scene_seed, width=config.width, height=config.height, variant=config.variant
    )


def make_sample(config: GenerateConfig, seed: int, index: int, renderer: SceneRenderer | None) -> Sample:
    """Sample `index` of the dataset (`config`, `seed`).

    renderer: needed unless `config.images` names a folder of photographs.
    """
    rng = np.random.default_rng(_streams(seed, index)[1])
    profile = load_profile(config.cameras[rng.integers(len(config.cameras))])
    if config.images:
        photos = find_photos(Path(config.images))
        photo = photos[index % len(photos)]
        pixels = crop_rand(rng, read_photo(photo), config.height, config.width)
        clean = clean_from_photo(rng, pixels, profile)
        origin: dict[str, Any] = {"image": photo.name}
    else:
        if renderer is None:
            raise ValueError("a renderer is needed to make samples from scenes")
        scene = scene_of(config, seed, index)
        clean = clean_from_frame(rng, renderer.render(scene), profile)
        origin = {"scene": to_plain(scene)}
    iso, level = level_rand(rng, profile, config.iso_range)
    noisy = noisy_from_clean(rng, clean, iso, level, profile.terms)
    record = {
        "key": sample_key(index),
        "fsid_version": __version__,
        "seed": seed,
        "index": index,
        "profile": profile.name,
        "camera": profile.camera,
        "cfa": clean.cfa,
        "black_level": noisy.black_level,
        "white_level": noisy.white_level,
        "white_balance": list(clean.white_balance),
        "xyz_to_camera": np.asarray(clean.xyz_to_camera).tolist(),
        "iso": iso,
        "k": list(level.k),
        "sigma2": list(level.sigma2),
        **origin,
    }
    return Sample(sample_key(index), clean, noisy, record)


def encode(sample: Sample) -> dict[str, bytes]:
    """The files of a sample by extension: two DNGs, a developed sRGB preview and the record."""
    preview = to_uint8(develop(sample.clean))
    return {
        "clean.dng": _dng(clean_levels(sample.clean)),
        "noisy.dng": _dng(sample.noisy),
        "rgb.png": _png(preview),
        "json": json.dumps(sample.record, indent=1).encode(),
    }


def to_uint8(srgb: np.ndarray) -> np.ndarray:
    """(..., 3) sRGB-encoded 0..1 as 8-bit values."""
    return np.round(np.clip(srgb, 0.0, 1.0) * 255.0).astype(np.uint8)


def _streams(seed: int, index: int) -> list[np.random.SeedSequence]:
    return np.random.SeedSequence(seed, spawn_key=(index,)).spawn(2)


def _dng(raw: Raw) -> bytes:
    file = io.BytesIO()
    write_dng(file, raw)
    return file.getvalue()


def _png(pixels: np.ndarray) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG", compress_level=1)
    return file.getvalue()
