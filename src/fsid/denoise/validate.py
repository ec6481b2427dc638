"""How good is the network so far: RAW PSNR on images that training never draws, always with the same noise.

    psnr = mean over images and ISOs of -10 log10 mean (net(clean + noise) - clean)^2,     data range 1

Noise comes from generators of (seed, image, ISO) alone, so that two moments of a training, and two trainings
of one seed, are compared on the same pixels. Held-out scenes choose the best weights; photographs only watch,
so that a network "trained on scenes alone" is not chosen by photographs either.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from fsid.dataset.index import StoredMosaic, index_mosaics
from fsid.dataset.photos import find_photos, read_photo
from fsid.denoise.raw_denoiser import RawDenoiser
from fsid.denoise.train_config import TrainConfig
from fsid.sensor import CameraProfile, Raw, bayer_crop, clean_from_photo, load_profile, noisy_from_clean, pack
from fsid.sensor.quantise import from_dn

WINDOW_PX = 256  # of the mosaic, from the middle of an image
ISO_LEVELS = 3  # log-spaced over the training's range, its ends included
_MAX_PHOTOS = 16
_STREAM = 0x7A11DA7E  # apart from the streams of training batches


@dataclass(frozen=True, eq=False)
class Capture:
    """One noisy window, packed (1, 4, h, w) as the network takes it, its truth, and k, sigma2 (1, 4)."""

    noisy: Tensor
    clean: Tensor
    k: Tensor
    sigma2: Tensor


class Validation:
    """Captures to measure on, by the name of their set; falsy where there are none."""

    def __init__(
        self, config: TrainConfig, sets: Mapping[str, Sequence[Capture]], device: torch.device
    ) -> None:
        self._sets = {name: captures for name, captures in sets.items() if captures}
        self._net = RawDenoiser(config.network).to(device).eval().requires_grad_(False)
        self._device = device

    def __bool__(self) -> bool:
        return bool(self._sets)

    @torch.no_grad()
    def measure(self, weights: Mapping[str, Tensor]) -> dict[str, float]:
        """Mean RAW PSNR in dB per set, of the network with `weights`."""
        self._net.load_state_dict(weights)
        return {
            name: float(np.mean([self._psnr(c) for c in captures])) for name, captures in self._sets.items()
        }

    def _psnr(self, capture: Capture) -> float:
        noisy, k, sigma2 = (t.to(self._device) for t in (capture.noisy, capture.k, capture.sigma2))
        error = self._net(noisy, k, sigma2).cpu().double() - capture.clean.double()
        return float(-10 * torch.log10(error.square().mean() + 1e-12))


def held_out(
    data_dir: Path, config: TrainConfig, keys: Iterable[str] | None = None
) -> tuple[StoredMosaic, ...]:
    """The images of `data_dir` with these keys; None: its last `config.held_out`.

    These are fewer where, with all other images of their scenes, they would be more than a fifth of it: a
    dataset of few pictures has each of them many times.
    """
    mosaics = index_mosaics(data_dir)
    if keys is not None:
        kept_keys = frozenset(keys)
        return tuple(mosaic for mosaic in mosaics if mosaic.key in kept_keys)
    of_scene = Counter(mosaic.scene for mosaic in mosaics)
    left, kept = len(mosaics) // 5, []
    for mosaic in mosaics[::-1][: config.held_out]:
        left -= of_scene.pop(mosaic.scene, 0)  # all of a scene with the first of it
        if left < 0:
            break
        kept.append(mosaic)
    return tuple(kept[::-1])


def validation(mosaics: Sequence[StoredMosaic], config: TrainConfig, device: torch.device) -> Validation:
    """On held-out scenes, and on the photographs of `config.validation_photos`."""
    scenes = [_window(_read(mosaic)) for mosaic in mosaics]
    photos = _photos(Path(config.validation_photos), config) if config.validation_photos else []
    sets = {"psnr_scenes": _captures(scenes, config), "psnr_photos": _captures(photos, config)}
    return Validation(config, sets, device)


def _read(mosaic: StoredMosaic) -> Raw:
    x = from_dn(mosaic.levels(), mosaic.black_level, mosaic.white_level)
    return Raw(x, mosaic.cfa, mosaic.black_level, mosaic.white_level, (1.0, 1.0, 1.0), np.eye(3))


def _photos(folder: Path, config: TrainConfig) -> list[Raw]:
    profile = load_profile(config.profiles[0])
    return [  # of NumPy, [seed, stream, i] and [seed, stream, i, 0] are one generator
        _window(
            clean_from_photo(
                np.random.default_rng([config.seed, _STREAM, i, ISO_LEVELS]), read_photo(path), profile
            )
        )
        for i, path in enumerate(find_photos(folder)[:_MAX_PHOTOS])
    ]


def _window(raw: Raw) -> Raw:
    """The middle of `raw`, from R on, so that it is an RGGB tile."""
    row, column = divmod(raw.cfa.index("R"), 2)
    height, width = ((length - 2) // 8 * 8 for length in raw.mosaic.shape)
    height, width = min(height, WINDOW_PX), min(width, WINDOW_PX)
    top, left = (
        (length - size) // 4 * 2 for length, size in zip(raw.mosaic.shape, (height, width), strict=True)
    )
    return bayer_crop(raw, top + row, left + column, height, width)


def _captures(images: Sequence[Raw], config: TrainConfig) -> list[Capture]:
    profiles = [load_profile(name) for name in config.profiles]
    isos = np.geomspace(config.iso_min, config.iso_max, ISO_LEVELS)
    return [
        _capture(np.random.default_rng([config.seed, _STREAM, number, order]), clean, profile, float(iso))
        for number, clean in enumerate(images)
        for order, iso in enumerate(isos)
        for profile in [profiles[(number + order) % len(profiles)]]
    ]


def _capture(rng: np.random.Generator, clean: Raw, profile: CameraProfile, iso: float) -> Capture:
    level = profile.level(iso)
    camera = replace(clean, black_level=profile.black_level, white_level=profile.white_level)
    noisy = noisy_from_clean(rng, camera, iso, level)
    noisy_packed, clean_packed = (
        torch.from_numpy(pack(raw.mosaic, raw.cfa)[None].astype(np.float32, copy=False))
        for raw in (noisy, clean)
    )
    k, sigma2 = (torch.tensor([values], dtype=torch.float32) for values in (level.k, level.sigma2))
    return Capture(noisy_packed, clean_packed, k, sigma2)
