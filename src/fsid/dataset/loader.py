"""Training patches: a fresh exposure of a random piece of a random clean mosaic, by (seed, step) alone.

    noisy = DN(clean + sqrt(k clean + sigma2 - r) n),    n ~ N(0, 1),    DN: round and clip as the camera's
    converter does, which adds r = 1/12 DN^2

**Flips.** A packed RAW hides where its four sites lie inside the 2x2 tile. Mirroring the packed planes keeps
their names but moves R from the left of Gr to its right: edges between planes jump by a pixel, and the
network would have to learn both geometries. Here the *mosaic* is mirrored, from a window that is shifted by
one pixel along the mirrored axis, so that after the mirror R is again at the top left (Liu et al. 2019,
"Learning raw image denoising with Bayer pattern unification and Bayer preserving augmentation"). The same
shift unifies the cameras' patterns: every patch, whatever its CFA, is an RGGB tile seen from R. A transpose
leaves R and B in place and swaps the places of Gr and Gb; the site names belong to the places (Gr shares its
row with R), and noise is added after it, so that each place gets its own k and sigma2.

**Order.** Batch `step` is drawn from `SeedSequence([seed, step, rank])` alone: a training that resumes at a
step sees what an undisturbed one would have seen, with any number of loading processes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from fsid.dataset.index import StoredMosaic, index_mosaics
from fsid.errors import FsidError
from fsid.sensor.formula import stored, with_noise
from fsid.sensor.mosaic import site_offsets
from fsid.sensor.noise import level_rand
from fsid.sensor.profiles import CameraProfile, load_profile
from fsid.sensor.quantise import ROUNDING_DN2
from fsid.sensor.raw import NoiseLevel


@dataclass(frozen=True)
class Batch:
    """B training patches: noisy, clean (B, 4, h, w) normalised float32 in R, Gr, Gb, B; k, sigma2 (B, 4)."""

    noisy: Tensor
    clean: Tensor
    k: Tensor
    sigma2: Tensor


@dataclass(frozen=True)
class PatchConfig:
    """What a batch is made of.

    size_px: side of a patch in packed pixels (a 2 size_px square of the mosaic). profiles: cameras whose
    noise is drawn, by name or file. iso_min, iso_max: log-uniform range. held_out: so many images at the end
    of the dataset are not drawn; they are for validation.
    """

    size_px: int
    batch: int
    profiles: tuple[str, ...]
    iso_min: float
    iso_max: float
    held_out: int = 0


class PatchDataset(Dataset[Batch]):
    """`dataset[step]` is the batch of that step; see the module docstring.

    Feed it to a `DataLoader` with `batch_size=None` and `sampler=range(first_step, steps)`.
    """

    def __init__(self, data_dir: Path, config: PatchConfig, seed: int, rank: int = 0) -> None:
        if not config.profiles:
            raise FsidError("profiles: name at least one camera profile to draw noise from")
        found = index_mosaics(data_dir)
        if not 0 <= config.held_out < len(found):
            raise FsidError(f"{data_dir}: has {len(found)} images; held_out {config.held_out} leaves none")
        self._mosaics = found[: len(found) - config.held_out]
        self._profiles = [load_profile(name) for name in config.profiles]
        self._config, self._seed, self._rank = config, seed, rank
        self._maps: dict[Path, np.memmap] = {}
        needed = 2 * config.size_px + 2  # one tile more than the patch, for the shift of a mirrored window
        for mosaic in self._mosaics:
            if min(mosaic.height, mosaic.width) < needed:
                raise FsidError(
                    f"{mosaic.shard}: {mosaic.key} is {mosaic.width}x{mosaic.height}, too small for "
                    f"patches of {config.size_px} packed pixels (needs {needed}x{needed}); lower it"
                )

    @property
    def mosaics(self) -> int:
        """How many images the patches come from."""
        return len(self._mosaics)

    def __getitem__(self, step: int) -> Batch:
        config = self._config
        rng = np.random.default_rng([self._seed, step, self._rank])
        clean = np.empty((config.batch, 4, config.size_px, config.size_px), np.float32)
        levels: list[NoiseLevel] = []
        cameras: list[CameraProfile] = []
        for patch in clean:
            mosaic = self._mosaics[rng.integers(len(self._mosaics))]
            cameras.append(self._profiles[rng.integers(len(self._profiles))])
            levels.append(level_rand(rng, cameras[-1], (config.iso_min, config.iso_max))[1])
            patch[:] = patch_rand(rng, self._pixels(mosaic), mosaic, config.size_px)
        k = np.array([level.k for level in levels], np.float32)
        sigma2 = np.array([level.sigma2 for level in levels], np.float32)
        noisy = _expose(rng, clean, k, sigma2, cameras)
        return Batch(*map(torch.from_numpy, (noisy, clean, k, sigma2)))

    def _pixels(self, mosaic: StoredMosaic) -> np.ndarray:
        if mosaic.shard not in self._maps:
            self._maps[mosaic.shard] = np.memmap(mosaic.shard, np.uint8, mode="r")
        end = mosaic.offset + 2 * mosaic.height * mosaic.width
        stored = self._maps[mosaic.shard][mosaic.offset : end].view("<u2")
        return stored.reshape(mosaic.height, mosaic.width)

    def __getstate__(self) -> dict[str, object]:
        """A worker process opens its own maps: a pickled memmap would be a copy of the shard."""
        return {**self.__dict__, "_maps": {}}


def patch_rand(
    rng: np.random.Generator, pixels: np.ndarray, mosaic: StoredMosaic, size_px: int
) -> np.ndarray:
    """A random window of DN `pixels` (H, W), mirrored and transposed at random: (4, size_px, size_px), x.

    The window is placed so that after mirroring its first pixel is R and the tile is RGGB.
    """
    red = site_offsets(mosaic.cfa)[0]
    window = []
    for length, red_offset in zip(pixels.shape, red, strict=True):
        mirrored = int(rng.integers(2))
        parity = (red_offset + mirrored) % 2
        start = parity + 2 * int(rng.integers((length - 2 * size_px - parity) // 2 + 1))
        cut = slice(start, start + 2 * size_px)
        window.append((cut, slice(None, None, -1 if mirrored else 1)))
    patch = pixels[window[0][0], window[1][0]][window[0][1], window[1][1]]
    if rng.integers(2):
        patch = patch.T
    packed = np.stack([patch[r::2, c::2] for r, c in site_offsets("RGGB")]).astype(np.float32)
    packed -= mosaic.black_level
    packed /= mosaic.white_level - mosaic.black_level
    return packed


def _expose(
    rng: np.random.Generator,
    clean: np.ndarray,
    k: np.ndarray,
    sigma2: np.ndarray,
    cameras: list[CameraProfile],
) -> np.ndarray:
    """`noisy_from_clean(...)` of the sensor, for a whole batch of levels and cameras at once."""
    span = np.array([camera.span for camera in cameras], np.float32)[:, None, None, None]
    black = np.array([camera.black_level for camera in cameras], np.float32)[:, None, None, None]
    injected = np.maximum(sigma2[:, :, None, None] - ROUNDING_DN2 / span**2, 0)
    normal = rng.standard_normal(clean.shape, dtype=np.float32)
    return stored(with_noise(clean, normal, k[:, :, None, None], injected), black, span)
