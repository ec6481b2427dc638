"""What the lens costs after a frame is drawn: python bench/lens.py [WIDTH HEIGHT].

Processor seconds of one core, least of five, of what the CPU does to a picture of 1920x1080: point spread and
sharpening, depth of field of a room of steps, fringes, contrast of colours; and the ratio of the blur behind
the first two to that of SciPy, for one colour and for three.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.ndimage import gaussian_filter1d

from fsid.render.blur import blurred, gaussian_weights
from fsid.render.colour_contrast import set_colour_contrast
from fsid.render.defocus import defocus
from fsid.render.fringes import magnified, with_margin
from fsid.render.sharpness import set_sharpness
from fsid.scene.model import Camera

SIGMAS_PX = (0.5, 0.8, 1.0, 1.5)


def seconds(work: Callable[[], object]) -> float:
    """Of processor time, the least of five."""
    times = []
    for _ in range(5):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def of_scipy(image: np.ndarray, sigma_px: float) -> np.ndarray:
    """The same blur by SciPy."""
    for axis in (0, 1):
        image = gaussian_filter1d(image, sigma_px, axis=axis, mode="nearest", truncate=3.0)
    return image


def main() -> None:
    width, height = (int(text) for text in sys.argv[1:3]) if len(sys.argv) > 2 else (1920, 1080)
    rng = np.random.default_rng(0)
    camera = Camera(
        (0.0, 0.0, 2.0), (0.0, 5.0, 2.0), (0.0, 0.0, 1.0), 50.0, width, height,
        softness_px=0.6, sharpening=0.5, chromatic_aberration=(8e-4, -6e-4), colour_contrast=(0.1, 0.05),
    )  # fmt: skip
    larger, margin = with_margin(camera)
    wide = rng.gamma(2.0, 1.0, (larger.height, larger.width, 3)).astype(np.float32)
    image = np.ascontiguousarray(wide[:height, :width])
    rows, columns = np.mgrid[:height, :width]
    depth = (1 + 2 * columns / width + 1.5 * ((columns // 97 + rows // 61) % 3)).astype(np.float32)
    stages = {
        "point spread and sharpening": lambda: set_sharpness(image.copy(), camera),
        "depth of field": lambda: defocus(image, depth, 0.01, 2.0, 0.8 * width),
        "fringes": lambda: magnified(wide, camera, margin),
        "contrast of colours": lambda: set_colour_contrast(image.copy(), camera),
    }
    for name, work in stages.items():
        print(f"{name}: {seconds(work):.3f} s")
    plane = np.ascontiguousarray(image[..., 0])
    for sigma_px in SIGMAS_PX:
        ratios = []
        for picture in (plane, image):
            theirs = seconds(partial(of_scipy, picture, sigma_px))
            ours = seconds(partial(blurred, picture, gaussian_weights(sigma_px)))
            ratios.append(theirs / ours)
        print(f"blur of {sigma_px} px: {ratios[0]:.1f} and {ratios[1]:.1f} times as fast as SciPy")


if __name__ == "__main__":
    main()
