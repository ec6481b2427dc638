"""Depth of field from one image beside the mean of many: python bench/defocus.py [--frames 4]

Sampled scenes whose lens is open (`lens.blur_share=1`), drawn sharp, with 1, 4 and 16 images from places on
the lens, and with as many as put them one pixel apart in the widest blur (at most --most): that is the truth.
PSNR of the radiance, its 97th percentile white, and processor time relative to a sharp frame.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from fsid.render import Renderer, exposure
from fsid.scene import Scene, SceneConfig, sample
from fsid.scene.camera_config import LensConfig

IMAGES = (1, 4, 16)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--frames", type=int, default=4, help="number of scenes")
    parser.add_argument("--width", type=int, default=480, help="of the image, 16:9")
    parser.add_argument("--most", type=int, default=256, help="images of the truth at most")
    parser.add_argument("--texture-size", type=int, default=256, help="texels per side of a material")
    options = parser.parse_args()
    height = options.width * 9 // 32 * 2
    config = SceneConfig(lens=LensConfig(blur_share=1.0, soft_share=0.0, sharp_share=0.0))
    scenes = [sample(config, seed, width=options.width, height=height) for seed in range(options.frames)]
    truths = drawn(scenes, options.most, options, step_px=1.0)
    sharp = drawn([without_blur(scene) for scene in scenes], 1, options)
    report("sharp", sharp, truths, sharp)
    for images in IMAGES:
        report(f"{images:3} images", drawn(scenes, images, options), truths, sharp)
    report("truth", truths, truths, sharp)


Drawn = list[tuple[np.ndarray, float]]


def drawn(
    scenes: list[Scene], images: int, options: argparse.Namespace, step_px: float = exposure.LENS_STEP_PX
) -> Drawn:
    """Radiance and processor seconds of every scene; the second draw is timed."""
    before, exposure.LENS_STEP_PX = exposure.LENS_STEP_PX, step_px
    found = []
    with Renderer(texture_size=options.texture_size, lens_images=images) as renderer:
        for scene in scenes:
            if images in (1, *IMAGES):
                renderer.render(scene)
            start = time.process_time()
            light = renderer.render(scene).radiance
            found.append((light, time.process_time() - start))
    exposure.LENS_STEP_PX = before
    return found


def without_blur(scene: Scene) -> Scene:
    """The scene with its lens all but closed."""
    return replace(scene, cameras=(replace(scene.cameras[0], aperture_m=0.0),))


def report(name: str, found: Drawn, truths: Drawn, sharp: Drawn) -> None:
    """One line: PSNR per scene, and time relative to sharp frames."""
    values = " ".join(
        f"{psnr(light, truth):6.1f}" for (light, _), (truth, _) in zip(found, truths, strict=True)
    )
    ratio = sum(cpu for _, cpu in found) / sum(cpu for _, cpu in sharp)
    print(f"{name:>10}: {values} dB, {ratio:.2f} times the time of sharp frames", flush=True)


def psnr(light: np.ndarray, truth: np.ndarray) -> float:
    white = np.quantile(truth, 0.97)
    error = np.clip(light / white, 0, 1).astype(float) - np.clip(truth / white, 0, 1)
    return float(-10 * np.log10(max((error**2).mean(), 1e-12)))


if __name__ == "__main__":
    main()
