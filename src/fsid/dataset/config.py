"""What a dataset is: together with a seed, everything that sample i depends on.

How the work is spread (workers, shard size) and how much of it is done (count) are not in here: they must
not change a sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fsid.config import Override, check_fields, from_plain, load_named, load_settings
from fsid.errors import FsidError
from fsid.scene import VARIANTS, SceneConfig
from fsid.yaml_json import read_yaml

DATASET_FILE = "config.yaml"
"""In the folder of a dataset: its `DatasetConfig`."""
TASKS = ("denoise", "super-resolution", "deblur", "burst")
RENDERERS = ("raster", "reference")
QUALITIES = ("high", "fast")
RENDERED = ("variant", "renderer", "quality", "supersampling", "lens_images", "texture_size", "scene")
"""Settings that pictures do not depend on: these are not rendered."""
_POSITIVE = ("crops", "exposures", "noise_levels", "lens_images")
_HIGHEST_ISO = 10_000_000
_LARGEST_PX = 16384
_MOST_PAIRS = 10_000


@dataclass(frozen=True)
class Checks:
    """What a sample must be; one that is not is drawn again, scene and all.

    black_share, blown_share: largest share of a clean image that may be darker than 1/1000 of saturation, or
    whose green is saturated; 0..1. duplicate_bits: two images are near-duplicates where at most so many of
    the 256 bits of their fingerprints differ; -1 looks for none. Pictures are not compared: the same one
    comes back on purpose where a dataset has more frames than its folder has pictures.
    """

    black_share: float = 0.5
    blown_share: float = 0.5
    duplicate_bits: int = 8

    def __post_init__(self) -> None:
        check_fields(self)
        for key in ("black_share", "blown_share"):
            if not 0 <= getattr(self, key) <= 1:
                raise FsidError(f"{key}: {getattr(self, key)} is not between 0 and 1")
        if not -1 <= self.duplicate_bits <= 256:
            raise FsidError(f"duplicate_bits: {self.duplicate_bits} is not between -1 and 256")


@dataclass(frozen=True)
class GenerateConfig:
    """Settings of `fsid generate`; `width` and `height` in pixels, even (the CFA is 2x2).

    task: one of TASKS, see `tasks`. scale: of super-resolution, 2 or 4.
    cameras: noise profiles, built-in names or files; each exposure draws one.
    iso_range: lowest and highest ISO, drawn log-uniformly.
    crops, exposures, noise_levels: how many of each a frame gives; it gives their product of pairs. All crops
    of a frame share its exposures (camera, colour, brightness), and each pair has noise of its own.
    crop_width, crop_height: pixels; 0 takes the whole frame. Of super-resolution multiples of 2 * scale, to
    which a frame that is none is cut.
    validation_every: one of so many scenes (or photographs) is for validation, with all its pairs; 0: none.
    renderer: raster (OpenGL), or reference (path tracer: slow, and its noise is in the clean image).
    quality: of the rasteriser, high or fast. supersampling: edge of the grid of samples per pixel.
    lens_images: at most so many images make one with depth of field; 1: one image, blurred by its depth.
    texture_size: pixels per edge of a baked material at most, a power of two; 0 follows the width (see
    `texture_px`). A scene of many materials has smaller ones (`fsid.render.layers`).
    images: a folder of photographs or linear .exr renders to use instead of scenes ("" renders scenes).
    """

    width: int = 1920
    height: int = 1080
    variant: str = "full"
    task: str = "denoise"
    scale: int = 2
    cameras: tuple[str, ...] = ("pixel6", "galaxy-s22")
    iso_range: tuple[float, float] = (400.0, 8000.0)
    crops: int = 1
    crop_width: int = 0
    crop_height: int = 0
    exposures: int = 1
    noise_levels: int = 1
    validation_every: int = 0
    renderer: str = "raster"
    quality: str = "high"
    supersampling: int = 2
    lens_images: int = 1
    texture_size: int = 0
    images: str = ""
    checks: Checks = field(default_factory=Checks)
    scene: SceneConfig = field(default_factory=SceneConfig)

    def __post_init__(self) -> None:
        check_fields(self)
        for key in ("width", "height"):
            size = getattr(self, key)
            if size < 32 or size % 2:
                raise FsidError(f"{key}: {size} is not an even number of at least 32 pixels")
            if size > _LARGEST_PX and not self.images:
                raise FsidError(f"{key}: scenes are rendered at up to {_LARGEST_PX} pixels, not {size}")
            self._check_crop(f"crop_{key}", size)
        choices = {"variant": VARIANTS, "task": TASKS, "renderer": RENDERERS, "quality": QUALITIES}
        for key, known in choices.items():
            if getattr(self, key) not in known:
                raise FsidError(f"{key}: {getattr(self, key)!r} is not one of {', '.join(known)}")
        if self.task == "burst" and self.renderer != "raster":
            raise FsidError(f"renderer: {self.renderer!r} knows no flow; --task burst needs raster")
        low, high = self.iso_range
        if not 0 < low <= high <= _HIGHEST_ISO:
            raise FsidError(f"iso_range: [{low}, {high}] must rise, above 0 and at most {_HIGHEST_ISO}")
        if not self.cameras:
            raise FsidError("cameras: at least one noise profile is needed")
        for key in _POSITIVE:
            if getattr(self, key) < 1:
                raise FsidError(f"{key}: {getattr(self, key)} is not a whole number of at least 1")
        if self.pairs_per_frame > _MOST_PAIRS:
            raise FsidError(
                f"crops, exposures, noise_levels: {self.pairs_per_frame} pairs of a frame, which are made "
                f"together; at most {_MOST_PAIRS}"
            )
        if self.validation_every < 0:
            raise FsidError(f"validation_every: {self.validation_every} is negative; 0 means no validation")
        if self.scale not in (2, 4):
            raise FsidError(f"scale: {self.scale} is neither 2 nor 4")
        self._check_tiles()
        if not 1 <= self.supersampling <= 4:
            raise FsidError(f"supersampling: {self.supersampling} is not between 1 and 4")
        if self.texture_size and (not 64 <= self.texture_size <= 4096 or self.texture_size.bit_count() != 1):
            raise FsidError(f"texture_size: {self.texture_size} is not 0 or a power of two from 64 to 4096")

    def _check_crop(self, key: str, frame: int) -> None:
        size = getattr(self, key)
        if size and not (32 <= size <= frame and size % 2 == 0):
            raise FsidError(
                f"{key}: {size} is not 0 or an even number of pixels from 32 to the frame's {frame}"
            )

    def _check_tiles(self) -> None:
        """FsidError for a crop that is not whole 2x2 tiles of the small image."""
        step = 2 * self.scale
        for key in ("width", "height") if self.task == "super-resolution" else ():
            size = getattr(self, f"crop_{key}")
            if size % step:
                below = size // step * step
                near = [each for each in (below, below + step) if each <= getattr(self, key)]
                raise FsidError(
                    f"crop_{key}: {size} is no multiple of {step} pixels, 2 of the small image with scale "
                    f"{self.scale}; take {' or '.join(map(str, near))}"
                )

    @property
    def windows(self) -> int:
        """How many different crops a frame has."""
        step = 2 * self.scale if self.task == "super-resolution" else 2
        free = (
            self.width // step - (self.crop_width or self.width) // step,
            self.height // step - (self.crop_height or self.height) // step,
        )
        return (free[0] + 1) * (free[1] + 1)

    @property
    def texture_px(self) -> int:
        """`texture_size`, or its default: the power of two at or above half the width, 128 to 1024."""
        return self.texture_size or 1 << min(max((self.width // 2 - 1).bit_length(), 7), 10)

    @property
    def pairs_per_frame(self) -> int:
        """How many pairs one rendered frame, or one photograph, gives."""
        return self.crops * self.exposures * self.noise_levels


@dataclass(frozen=True)
class DatasetConfig:
    """What `config.yaml` beside the shards says: the identity of the dataset.

    pictures: how many there are in the folder `generate.images`; 0 for scenes. pictures_digest: of their
    names and sizes; "" for scenes, and unknown in what FSID wrote before it was recorded. profiles_digest: of
    the noise in profiles that are files; "" where there is none, and likewise. files_digest: of the usable
    files of the folders of meshes, textures and skies, by names and sizes; "" likewise.
    """

    seed: int
    shard_size: int
    generate: GenerateConfig
    pictures: int = 0
    pictures_digest: str = ""
    profiles_digest: str = ""
    files_digest: str = ""

    def __post_init__(self) -> None:
        check_fields(self)
        if self.seed < 0:
            raise FsidError(f"seed {self.seed}: must not be negative")


def split_of(config: GenerateConfig, number: int) -> str:
    """ "train" or "validation": where scene or picture `number` belongs with all its samples."""
    every = config.validation_every
    return "validation" if every and number % every == every - 1 else "train"


def generate_config(name_or_file: str | Path | None, overrides: Sequence[Override] = ()) -> GenerateConfig:
    """A built-in configuration by name (`fsid/configs`), or a YAML file; overrides on top.

    The file may be the config.yaml of a dataset: its settings are taken, its seed is not.
    """
    if name_or_file is None:
        return load_settings(GenerateConfig, None, overrides)
    return load_named(GenerateConfig, name_or_file, overrides, _read_settings)


def _read_settings(file: Path) -> dict[str, Any]:
    plain = read_yaml(file)
    if "generate" not in plain:
        return plain
    from_plain(DatasetConfig, plain, source=str(file))  # whatever else it says must be of a dataset, too
    return dict(plain["generate"])
