"""What a dataset is: together with a seed, everything that sample i depends on.

How the work is spread (workers, shard size) and how much of it is done (count) are not in here: they must
not change a sample.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from fsid.errors import FsidError
from fsid.scene import VARIANTS, SceneConfig


@dataclass(frozen=True)
class GenerateConfig:
    """Settings of `fsid generate`; `width` and `height` in pixels, even (the CFA is 2x2).

    cameras: noise profiles, built-in names or files; each sample draws one.
    iso_range: lowest and highest ISO, drawn log-uniformly.
    supersampling: edge of the grid of samples per pixel. texture_size: pixels per
    edge of a baked material, a power of two; 0 follows the width (see `texture_px`).
    images: a folder of photographs to use instead of scenes ("" renders scenes).
    """

    width: int = 1920
    height: int = 1080
    variant: str = "full"
    cameras: tuple[str, ...] = ("pixel6", "galaxy-s22")
    iso_range: tuple[float, float] = (400.0, 8000.0)
    supersampling: int = 2
    texture_size: int = 0
    images: str = ""
    scene: SceneConfig = field(default_factory=SceneConfig)

    def __post_init__(self) -> None:
        for key in ("width", "height"):
            size = getattr(self, key)
            if size < 32 or size % 2:
                raise FsidError(f"{key}: {size} is not an even number of at least 32 pixels")
        if self.variant not in VARIANTS:
            raise FsidError(f"variant: {self.variant!r} is not one of {', '.join(VARIANTS)}")
        low, high = self.iso_range
        if not 0 < low <= high:
            raise FsidError(f"iso_range: [{low}, {high}] must be two positive numbers, the lower first")
        if not self.cameras:
            raise FsidError("cameras: at least one noise profile is needed")
        if not 1 <= self.supersampling <= 4:
            raise FsidError(f"supersampling: {self.supersampling} is not between 1 and 4")
        if self.texture_size and (not 64 <= self.texture_size <= 4096 or self.texture_size.bit_count() != 1):
            raise FsidError(f"texture_size: {self.texture_size} is not 0 or a power of two from 64 to 4096")

    @property
    def texture_px(self) -> int:
        """`texture_size`, or its default: the power of two at or above half the width, 128 to 1024."""
        return self.texture_size or 1 << min(max((self.width // 2 - 1).bit_length(), 7), 10)
