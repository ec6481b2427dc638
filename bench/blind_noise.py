"""How good the blind noise estimate is: python bench/blind_noise.py [FOLDER_OF_PHOTOS...] [--emva FOLDER].

Photographs (those that scikit-image ships, or of the given folders) become RAW of a Pixel 6 at five ISOs, one
seed. Per ISO, over the photographs: the error of the noise sigma averaged over the picture, which is what a
denoiser feels, in percent (10th percentile, median, 90th); the median error of k and of sigma2, in percent,
and how many were refused. With --emva, the folder of the EMVA 1288 reference sets: pictures of 64-row strips,
each from one exposure of the sensor, against the reference figures of its temporal noise; as they are, with
the fixed pattern, which one image cannot tell from noise, and with the noise of pair differences alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import gaussian_filter

from fsid.errors import FsidError
from fsid.sensor import (
    NoiseEstimate,
    Raw,
    clean_from_photo,
    estimate_noise,
    load_profile,
    noisy_from_clean,
    pack,
)

PROFILE = load_profile("pixel6")
SHIPPED = ("astronaut", "coffee", "chelsea", "rocket")
REFERENCE = {"001": (0.28006, 3.0731), "003": (0.09786, 3.0130)}
STRIP = 64


def photos(folders: list[Path]) -> Iterator[np.ndarray]:
    """(H, W, 3) float32 sRGB 0..1."""
    if not folders:
        from skimage import data

        yield from (getattr(data, name)().astype(np.float32) / 255 for name in SHIPPED)
    for path in sorted(path for folder in folders for path in folder.iterdir()):
        yield np.asarray(Image.open(path).convert("RGB"), np.float32) / 255


def simulated(pictures: list[np.ndarray]) -> None:
    print(f"{len(pictures)} photographs as RAW of {PROFILE.camera}, errors in percent")
    print("   ISO   sigma 10 %  median  90 %   |k|  |sigma2|  refused")
    for iso in (400, 800, 1600, 3200, 6400):
        level, found = PROFILE.level(iso), []
        k, sigma2 = np.array([level.k, level.sigma2])[..., None]
        for number, picture in enumerate(pictures):
            rng = np.random.default_rng([number, iso])
            clean = clean_from_photo(rng, picture, PROFILE)
            try:
                estimate = estimate_noise(noisy_from_clean(rng, clean, iso, level)).level
            except FsidError:
                continue
            x = pack(clean.mosaic, PROFILE.cfa).reshape(4, -1)
            own_k, own_sigma2 = np.array([estimate.k, estimate.sigma2])[..., None]
            ratio = np.sqrt((own_k * x + own_sigma2) / (k * x + sigma2)).mean()
            errors = (ratio - 1, np.abs(own_k / k - 1).mean(), np.abs(own_sigma2 / sigma2 - 1).mean())
            found.append(100 * np.array(errors))
        sigma, k_error, sigma2_error = np.transpose(found)
        low, middle, high = np.percentile(sigma, (10, 50, 90))
        print(
            f"{iso:6d}      {low:6.1f}  {middle:6.1f} {high:6.1f} {np.median(k_error):5.0f} "
            f"{np.median(sigma2_error):8.0f}  {len(pictures) - len(found):7d}"
        )


def emva(folder: Path) -> None:
    print("EMVA 1288: k in DN, dark noise in DN; stated error; reference")
    for name, (k, dark_std) in REFERENCE.items():
        images = folder / name / "images"
        black = float(np.mean(np.asarray(Image.open(min(images.glob("d_0*"))), np.float64)))
        pairs = [
            [
                np.asarray(Image.open(path.with_name(f"{path.stem[:-3]}{n:03d}.png")), np.float32)
                for n in (1, 2)
            ]
            for path in sorted(images.glob("b_[0-9]*_001.png"))
        ]
        pairs = [pair for pair in pairs if pair[0].mean() < 0.7 * 4095]
        temporal = [(a - b) / np.sqrt(2) + gaussian_filter((a + b) / 2, 8) for a, b in pairs]
        for what, flats in (("as it is", [pair[0] for pair in pairs]), ("temporal", temporal)):
            x = (np.concatenate([flat[:STRIP] for flat in flats]) - black) / (4095 - black)
            raw = Raw(x.astype(np.float32), "RGGB", round(black), 4095, (1.0, 1.0, 1.0), np.eye(3))
            print(f"{name} {what}: {against(estimate_noise(raw), 4095 - black, k, dark_std)}")


def against(found: NoiseEstimate, span: float, k: float, dark_std: float) -> str:
    """What was found, mean of the sites in DN, against the reference."""
    own_k, own_std = np.mean(found.level.k) * span, np.sqrt(np.mean(found.level.sigma2)) * span
    k_error = np.mean(found.k_error) * span
    std_error = np.mean(found.sigma2_error) * span**2 / 2 / own_std
    return (
        f"k {own_k:.4f} +- {k_error:.4f} ({k:.4f}, {100 * (own_k / k - 1):+.1f} %), dark noise "
        f"{own_std:.2f} +- {std_error:.2f} ({dark_std:.2f}, {100 * (own_std / dark_std - 1):+.1f} %)"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--emva", type=Path)
    given = parser.parse_args()
    simulated(list(photos(given.folders)))
    if given.emva is not None:
        emva(given.emva)
