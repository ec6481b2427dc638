"""What would help a network: python bench/altered_pictures.py DATA OUT [--calm LOW HIGH] [--soft ...] ...

Writes the previews of a dataset as PNG files, altered: `--calm`: the chroma within surfaces (what an
edge-preserving filter removes) times a factor drawn from the range; `--saturation`: all chroma times a
factor; `--soft`: a Gaussian of a standard deviation drawn from the range, pixels. Each is done to a share
of the pictures, drawn per picture and seeded. Then `fsid generate NEW --images OUT` makes pairs of them:
two networks trained on sets that differ in this one thing say whether the generator should be changed,
before any scene is rendered (docs/rounds.md).
"""

from __future__ import annotations

import argparse
import io
import tarfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import gaussian_filter, uniform_filter

YCC = np.array([[0.299, 0.587, 0.114], [-0.1687, -0.3313, 0.5], [0.5, -0.4187, -0.0813]])
WINDOW_PX = 17
EDGE = 0.06
"""Differences of chroma above this, of 1, count as edges between surfaces."""


def previews(data: Path) -> Iterator[np.ndarray]:
    """(H, W, 3) sRGB-encoded 0..1."""
    for shard in sorted(data.glob("shard-*.tar")):
        with tarfile.open(shard) as tar:
            for member in tar:
                if member.name.endswith(".rgb.png") and (file := tar.extractfile(member)):
                    yield np.asarray(Image.open(io.BytesIO(file.read())).convert("RGB")) / 255.0


def smooth(plane: np.ndarray) -> np.ndarray:
    """Guided filter of a plane by itself (He, Sun and Tang, TPAMI 2013): texture goes, edges stay."""

    def mean(x: np.ndarray) -> np.ndarray:
        return uniform_filter(x, WINDOW_PX, mode="reflect")

    level = mean(plane)
    variance = mean(plane * plane) - level * level
    slope = variance / (variance + EDGE**2)
    return mean(slope) * plane + mean(level * (1 - slope))


def altered(rng: np.random.Generator, srgb: np.ndarray, given: argparse.Namespace) -> np.ndarray:
    """The picture with what `given` asks for; every number is drawn, whatever the share leaves out."""
    ycc = srgb @ YCC.T
    does = rng.random(3) < given.share
    calm, saturation, soft = (rng.uniform(*pair) for pair in (given.calm, given.saturation, given.soft))
    if does[0]:
        for plane in (1, 2):
            base = smooth(ycc[..., plane])
            ycc[..., plane] = base + calm * (ycc[..., plane] - base)
    if does[1]:
        ycc[..., 1:] *= saturation
    if does[2] and soft > 0:
        ycc = gaussian_filter(ycc, (soft, soft, 0), mode="reflect")
    return np.clip(ycc @ np.linalg.inv(YCC).T, 0.0, 1.0)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--calm", type=float, nargs=2, default=(1.0, 1.0), metavar=("LOW", "HIGH"))
    parser.add_argument("--saturation", type=float, nargs=2, default=(1.0, 1.0), metavar=("LOW", "HIGH"))
    parser.add_argument("--soft", type=float, nargs=2, default=(0.0, 0.0), metavar=("LOW", "HIGH"))
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    given.out.mkdir(parents=True)
    for number, srgb in enumerate(previews(given.data)):
        rng = np.random.default_rng((given.seed, number))
        pixels = altered(rng, srgb, given) * 255 + rng.random(srgb.shape)  # dithered: no contours
        Image.fromarray(pixels.astype(np.uint8)).save(given.out / f"{number:05d}.png", compress_level=1)


if __name__ == "__main__":
    main()
