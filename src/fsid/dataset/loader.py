"""Training patches: every patch of the dataset once per epoch, with a fresh exposure, by (seed, step) alone.

    noisy = DN(clean + sqrt(k clean + sigma2 - r) n),    n ~ N(0, 1),    DN: round and clip as the camera's
    converter does, which adds r = 1/12 DN^2

**Epochs.** A mosaic is cut into a grid of patches, and those of all mosaics come in a random order
(`patch_grid`). With W ranks of batch B, the places of an epoch are dealt out in turn:

    place = (step W + rank) B + slot

So no patch comes twice in an epoch, on whatever ranks and with any number of loading processes; no rank has
more than another, however the images lie in the shards; and a resumed training goes on where it was.

**Sizes.** Images may be made smaller first (`fsid.sensor.mosaic.halved`, before noise is drawn): what fills a
patch of a large image then takes a small part of one. With several factors every one has epochs of its own,
and they take turns.

**Flips.** A packed RAW hides where its four sites lie inside the 2x2 tile. Mirroring the packed planes keeps
their names but moves R from the left of Gr to its right: edges between planes jump by a pixel, and the
network would have to learn both geometries. Here the *mosaic* is mirrored, from a window that is shifted by
one pixel along the mirrored axis, so that after the mirror R is again at the top left (Liu et al. 2019,
"Learning raw image denoising with Bayer pattern unification and Bayer preserving augmentation"). The same
shift unifies the cameras' patterns: every patch, whatever its CFA, is an RGGB tile seen from R. A transpose
leaves R and B in place and swaps the places of Gr and Gb; the site names belong to the places (Gr shares its
row with R). Noise is added after it, so that each place gets its own k and sigma2; those of stored noise are
swapped with it.
"""

from __future__ import annotations

import operator
from collections import OrderedDict
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from fsid.config import check_fields
from fsid.dataset.index import StoredMosaic, degraded_in, index_mosaics
from fsid.dataset.noise_levels import LevelTable
from fsid.dataset.patch_grid import Cell, Grid, check_shrink, shrink_for
from fsid.errors import FsidError
from fsid.plurals import counted
from fsid.sensor.formula import stored, with_noise
from fsid.sensor.gaussian import standard_normal
from fsid.sensor.mosaic import halved, site_offsets
from fsid.sensor.profiles import CameraProfile, load_bayer_profile
from fsid.sensor.quantise import ROUNDING_DN2
from fsid.sensor.raw import NoiseLevel

_OPEN_MAPS = 256
"""Each mapped shard holds a file descriptor, of which a process has 1024."""

Noise = Literal["fresh", "stored"]
Split = Literal["train", "validation"]
Cut = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Batch:
    """B training patches: noisy, clean (B, 4, h, w) normalised float32 in R, Gr, Gb, B; k, sigma2 (B, 4)."""

    noisy: Tensor
    clean: Tensor
    k: Tensor
    sigma2: Tensor

    @property
    def tensors(self) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Those above, in their order."""
        return self.noisy, self.clean, self.k, self.sigma2

    def to(self, device: torch.device | str, *, non_blocking: bool = False) -> Batch:
        """The batch on a device, as `Tensor.to` brings it there."""
        return Batch(*(tensor.to(device, non_blocking=non_blocking) for tensor in self.tensors))

    def pin_memory(self) -> Batch:
        """The batch in page-locked memory, from which a GPU copies faster; PyTorch's loader asks for it."""
        return Batch(*(tensor.pin_memory() for tensor in self.tensors))


@dataclass(frozen=True)
class PatchConfig:
    """What a batch is made of.

    size_px: side of a patch in packed pixels (a 2 size_px square of the mosaic). profiles: cameras whose
    noise is drawn, by name or file. iso_min, iso_max: log-uniform range. held_out: so many images at the end
    of the dataset are for validation, with others of their scenes and those that the dataset keeps for it.
    noise: "fresh" draws it anew every time; "stored" takes the noisy images of the dataset, and profiles and
    ISO play no part. shrink: how many times smaller images are made, powers of 2; as many patches of each.
    Empty: 1, 2, 4 ... while the longer side of most images keeps 480 pixels (stored noise: as they are).
    split: "train" draws from the images that are not for validation, "validation" from those that are.
    """

    size_px: int
    batch: int
    profiles: tuple[str, ...]
    iso_min: float
    iso_max: float
    held_out: int = 0
    noise: Noise = "fresh"
    shrink: tuple[int, ...] = (1,)
    split: Split = "train"

    def __post_init__(self) -> None:
        check_fields(self)
        if self.size_px < 1 or self.batch < 1:
            raise FsidError(f"size_px {self.size_px}, batch {self.batch}: must be at least 1")
        check_shrink(self.shrink)
        if self.noise == "stored" and self.shrink not in ((), (1,)):
            raise FsidError(f"shrink {list(self.shrink)}: stored noise is of the images as they are")


class PatchDataset(Dataset[Batch]):
    """`dataset[step]` is the batch of that step; see the module docstring.

    Steps have no end and the dataset no len(): a loop says which steps it wants, as in `DataLoader(dataset,
    batch_size=None, sampler=range(1000), num_workers=2)`, or faster, `feed.batches(dataset, range(1000), 2)`.
    rank, world: this process among those that train together; None asks `torch.distributed`, and is 0 of 1
    where that was not set up. without: numbers of scenes to hold out as well. FsidError: a negative seed or
    step, and what is wrong with the data or the configuration.
    """

    def __init__(
        self,
        data_dir: str | Path,
        config: PatchConfig,
        seed: int,
        rank: int | None = None,
        world: int | None = None,
        without: Collection[int] = (),
    ) -> None:
        data_dir, seed = Path(data_dir), operator.index(seed)
        if not config.profiles:
            raise FsidError("profiles: name at least one camera profile to draw noise from")
        if seed < 0:
            raise FsidError(f"seed {seed}: must not be negative")
        own_rank, all_ranks = _place_among_processes()
        self._rank = own_rank if rank is None else operator.index(rank)
        self._world = all_ranks if world is None else operator.index(world)
        if not 0 <= self._rank < self._world:
            raise FsidError(
                f"rank {self._rank}: is not one of the {self._world} processes that train together"
            )
        self._mosaics = _mosaics_of_split(data_dir, config, without)
        self._noisy = _noisy_of(data_dir, self._mosaics) if config.noise == "stored" else {}
        self._profiles = [load_bayer_profile(name) for name in config.profiles]
        self._levels = LevelTable(self._profiles, (config.iso_min, config.iso_max))
        self._config, self._seed = config, seed
        self._maps: OrderedDict[Path, np.ndarray] = OrderedDict()
        self._grids = [Grid(self._mosaics, config.size_px, shrink) for shrink in self._sizes()]

    @property
    def mosaics(self) -> int:
        """How many images the patches come from."""
        return len(self._mosaics)

    @property
    def shrink(self) -> tuple[int, ...]:
        """How many times smaller the images are made, as chosen where the configuration leaves it open."""
        return tuple(grid.shrink for grid in self._grids)

    @property
    def patches(self) -> int:
        """How many patches an epoch has, of images of all sizes and all ranks together."""
        return sum(grid.patches for grid in self._grids)

    def _sizes(self) -> tuple[int, ...]:
        if self._config.noise == "stored":
            return (1,)
        return self._config.shrink or shrink_for(self._mosaics, self._config.size_px)

    def empty_batch(self) -> Batch:
        """Memory for a batch, not filled yet."""
        shape = (self._config.batch, 4, self._config.size_px, self._config.size_px)
        return Batch(*(torch.empty(size) for size in (shape, shape, shape[:2], shape[:2])))

    def __getitem__(self, step: int) -> Batch:
        batch = self.empty_batch()
        self.fill(batch, step)
        return batch

    def fill(self, batch: Batch, step: int) -> None:
        """Make the batch of a step in the memory of `batch`."""
        config, step = self._config, operator.index(step)  # NumPy's numbers, as a sampler's, overflow
        if step < 0:
            raise FsidError(f"step {step}: must not be negative")
        rng = np.random.default_rng([self._seed, step, self._rank])
        noisy, clean, k, sigma2 = (t.numpy() for t in (batch.noisy, batch.clean, batch.k, batch.sigma2))
        if config.noise == "fresh":
            cameras, k[:], sigma2[:] = self._levels.draw_rand(rng, config.batch)
        first = (step * self._world + self._rank) * config.batch
        for slot in range(config.batch):
            position, turn = divmod(first + slot, len(self._grids))
            cell = self._grids[turn].cell(position, self._seed)
            cut, is_transposed = window_rand(rng, cell.mosaic, cell.corner_inside, config.size_px)
            packed(self._around(cell, cell.mosaic), cell.mosaic, cut, clean[slot])
            if config.noise == "fresh":
                noisy[slot] = _exposed(rng, clean[slot], k[slot], sigma2[slot], self._profiles[cameras[slot]])
            else:
                capture, level = self._noisy[cell.mosaic.shard, cell.mosaic.key]
                packed(self._around(cell, capture), capture, cut, noisy[slot])
                level = level.transposed if is_transposed else level
                k[slot], sigma2[slot] = level.k, level.sigma2

    def _around(self, cell: Cell, mosaic: StoredMosaic) -> np.ndarray:
        """DN (H, W) of a mosaic of the cell's image: the tiles around the cell, made smaller as it says."""
        pixels = self._pixels(mosaic)[cell.window]
        for _ in range(cell.shrink.bit_length() - 1):
            pixels = halved(pixels)
        return pixels

    def _pixels(self, mosaic: StoredMosaic) -> np.ndarray:
        if mosaic.shard not in self._maps:
            if len(self._maps) == _OPEN_MAPS:
                self._maps.popitem(last=False)
            self._maps[mosaic.shard] = mosaic.opened()
        return mosaic.in_map(self._maps[mosaic.shard])

    def __getstate__(self) -> dict[str, object]:
        """A worker process opens its own maps: a pickled memmap would be a copy of the shard."""
        return {**self.__dict__, "_maps": OrderedDict()}


def window_rand(
    rng: np.random.Generator, mosaic: StoredMosaic, corner: tuple[int, int], size_px: int
) -> tuple[Cut, bool]:
    """How to cut the cell at `corner` out of a mosaic, mirrored and transposed at random; whether transposed.

    The cut (2 size_px, 2 size_px) is placed in the cell so that its first pixel is R and its tile RGGB.
    """
    slices = []
    chance = int(rng.integers(8))
    for axis, (start, red) in enumerate(zip(corner, site_offsets(mosaic.cfa)[0], strict=True)):
        is_mirrored = chance >> axis & 1
        start += (start + red + is_mirrored) % 2
        stop = start + 2 * size_px
        if is_mirrored:
            slices.append(slice(stop - 1, start - 1 if start else None, -1))
        else:
            slices.append(slice(start, stop))
    rows, columns = slices
    if chance & 4:
        return lambda pixels: pixels[rows, columns].T, True
    return lambda pixels: pixels[rows, columns], False


def packed(pixels: np.ndarray, mosaic: StoredMosaic, cut: Cut, out: np.ndarray) -> None:
    """The RGGB cut of DN `pixels` (H, W) as x, into `out` (4, size_px, size_px)."""
    size_px = out.shape[1]
    window = np.ascontiguousarray(cut(pixels)).reshape(size_px, 2, size_px, 2)
    out.reshape(2, 2, size_px, size_px)[:] = window.transpose(1, 3, 0, 2)
    out -= mosaic.black_level
    out *= np.float32(1 / (mosaic.white_level - mosaic.black_level))


def _exposed(
    rng: np.random.Generator, clean: np.ndarray, k: np.ndarray, sigma2: np.ndarray, camera: CameraProfile
) -> np.ndarray:
    """`noisy_from_clean(...)` of the sensor, for one packed patch; k, sigma2 (4,) float32."""
    injected = sigma2 - np.float32(ROUNDING_DN2 / camera.span**2)
    normal = standard_normal(rng, clean.shape)
    noisy = with_noise(clean, normal, k[:, None, None], injected.clip(min=0)[:, None, None])
    return stored(noisy, camera.black_level, camera.span)


def _mosaics_of_split(
    data_dir: Path, config: PatchConfig, without: Collection[int]
) -> tuple[StoredMosaic, ...]:
    found = index_mosaics(data_dir)
    if not 0 <= config.held_out < len(found):
        raise FsidError(
            f"{data_dir}: has {counted(len(found), 'image')}; held_out {config.held_out} leaves none"
        )
    held_out = {*without, *(mosaic.scene for mosaic in found[len(found) - config.held_out :])}
    wants_training = config.split == "train"
    kept = tuple(m for m in found if (m.split == "train" and m.scene not in held_out) == wants_training)
    if not kept and wants_training:
        raise FsidError(f"{data_dir}: all its images are for validation; generate more scenes")
    if not kept:
        raise FsidError(f"{data_dir}: none of its images is for validation; set held_out")
    return kept


def _noisy_of(
    data_dir: Path, mosaics: tuple[StoredMosaic, ...]
) -> dict[tuple[Path, str], tuple[StoredMosaic, NoiseLevel]]:
    """By shard and key of a clean mosaic the noisy one and its level; FsidError where they do not fit."""
    if shard := degraded_in(data_dir):
        raise FsidError(
            f"{shard}: noisy images of --task deblur or super-resolution differ from the clean ones by more "
            "than noise; take fresh noise"
        )
    noisy = {(mosaic.shard, mosaic.key): mosaic for mosaic in index_mosaics(data_dir, "noisy")}
    found = {}
    for clean in mosaics:
        capture = noisy.get((clean.shard, clean.key))
        if capture is None or capture.noise is None:
            raise FsidError(f"{clean.shard}: {clean.key} has no noisy image that states its noise")
        try:
            capture.noise.check()
        except FsidError as error:
            raise FsidError(f"{clean.shard}: {clean.key}.noisy.dng: {error}") from None
        if (capture.height, capture.width, capture.cfa) != (clean.height, clean.width, clean.cfa):
            raise FsidError(
                f"{clean.shard}: {clean.key} is no denoising pair, its two images differ in size or CFA"
            )
        found[clean.shard, clean.key] = capture, capture.noise
    return found


def _place_among_processes() -> tuple[int, int]:
    """(rank, world) of this process, as `torch.distributed` knows them."""
    distributed = torch.distributed
    if not (distributed.is_available() and distributed.is_initialized()):
        return 0, 1
    return distributed.get_rank(), distributed.get_world_size()
