"""What a smaller form of a network costs, in dB of RAW PSNR.

    loss = mean psnr(network) - mean psnr(smaller form),     psnr over windows of photographs at five ISOs

The photographs are those that scikit-image ships, unprocessed to RAW, with the noise of a Pixel 6. They
measure a difference between two forms of one network, not how good either is: `fsid evaluate` does that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import as_file, files

import numpy as np

from fsid.dataset.photos import read_photo
from fsid.denoise.denoise import Network, denoise_raw
from fsid.sensor import Raw, clean_from_photo, load_profile, noisy_from_clean

MEASURED = ("astronaut.png", "chelsea.png", "coffee.png")
CALIBRATED = ("rocket.jpg", "motorcycle_left.png", "retina.jpg")  # others, for ranges of activations
ISOS = (400, 800, 1600, 3200, 6400)
CALIBRATED_ISOS = (100, 800, 6400, 25600, 64000)
"""To more noise than any camera has whose profile ships, at the ISO 12800 up to which the network that ships
was trained: what lies beyond a range of activations is cut off."""
_WINDOW_PX = 256
_CAMERA = "pixel6"


@dataclass(frozen=True, eq=False)
class Probe:
    """A noisy window and its truth (H, W)."""

    noisy: Raw
    clean: np.ndarray


def probes(photographs: Sequence[str] = MEASURED, isos: Sequence[int] = ISOS) -> list[Probe]:
    """The middle of each photograph at each of `isos`; the same pixels on every call."""
    profile = load_profile(_CAMERA)
    found = []
    for number, name in enumerate(photographs):
        rng = np.random.default_rng([number, _WINDOW_PX])
        with as_file(files("skimage.data") / name) as file:
            photo = read_photo(file)
        top, left = ((length - _WINDOW_PX) // 2 for length in photo.shape[:2])
        clean = clean_from_photo(rng, photo[top : top + _WINDOW_PX, left : left + _WINDOW_PX], profile)
        found += [Probe(noisy_from_clean(rng, clean, iso, profile.level(iso)), clean.mosaic) for iso in isos]
    return found


def mean_psnr(network: Network, measured: Sequence[Probe], *, ensemble: int = 1) -> float:
    """Mean over probes of the RAW PSNR in dB, data range 1. ensemble: as for `denoise_raw`."""
    clean = (denoise_raw(probe.noisy, network, ensemble=ensemble).mosaic for probe in measured)
    errors = [np.mean((c - p.clean) ** 2, dtype=float) for c, p in zip(clean, measured, strict=True)]
    return float(np.mean(-10 * np.log10(errors)))
