"""What a task makes of a scene: the truth and what the camera sees instead, all of it noise-free light.

    denoise            seen = truth
    super-resolution   seen = truth * PSF, averaged over scale x scale pixels        PSF: Gaussian
    deblur             seen = the same view while the shutter is open, truth = its middle
    burst              seen = F frames of a hand-held camera, truth = the first

The PSF is the lens: its sigma is drawn between a quarter and half a pixel of the small image, for each axis
by itself (astigmatism), so that the lens resolves neither much more than the pixels do nor much less. The
average is the pixel, which collects light over its whole area. Both are linear, and come before the colour
filters. Motion of camera and objects is the scene's (`scene.motion`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np
from scipy.ndimage import gaussian_filter

from fsid.dataset.config import GenerateConfig
from fsid.dataset.pictures import is_render
from fsid.errors import FsidError
from fsid.render import Frame
from fsid.scene import Scene, SceneConfig

PSF_SIGMA_PX = (0.25, 0.5)
"""Range of the lens' sigma in pixels of the small image."""
BURST_FRAMES = 5
SHUTTER_S = (0.02, 0.12)
MOVING_SHARE = 0.3


class SceneRenderer(Protocol):
    """Anything that turns a scene into light (H, W, 3)."""

    def radiance(self, scene: Scene, camera_index: int = 0) -> np.ndarray: ...


class FlowRenderer(SceneRenderer, Protocol):
    """One that knows where the points of one camera's image are in another's."""

    def render(self, scene: Scene, camera_index: int = 0, flow_to: int | None = None) -> Frame: ...


@dataclass(frozen=True, eq=False)
class Views:
    """What one frame gives. Light of any unit, linear unless it comes from a photograph.

    truth: (H, W, 3). seen: images (H / scale, W / scale, 3) of which noisy RAWs are made. flow: for each
    image but the first (H, W, 2), pixels right and down from a point there to the same point in the first;
    NaN where nothing was hit. facts: what was drawn, for the record.
    """

    truth: np.ndarray
    seen: tuple[np.ndarray, ...]
    flow: tuple[np.ndarray, ...] = ()
    scale: int = 1
    facts: dict[str, Any] = field(default_factory=dict)


def check_cameras(config: GenerateConfig) -> None:
    """FsidError where scenes have cameras that no task renders: every task sees through the first eye."""
    eyes = config.scene.rig.eyes
    if eyes > 1 and not config.images:
        raise FsidError(
            f"scene.rig.eyes: {eyes}, but --task {config.task} renders the first eye alone; "
            "write such scenes with fsid scene and render each camera with fsid.render.Renderer"
        )


def check_task(config: GenerateConfig, pictures: Sequence[Path]) -> None:
    """FsidError where `pictures` are no source for the task of `config`."""
    if pictures and config.task in ("deblur", "burst"):
        raise FsidError(f"--task {config.task}: needs scenes, in which things move, and not pictures")
    photograph = next((path for path in pictures if not is_render(path)), None)
    if photograph and config.task == "super-resolution":
        raise FsidError(
            f"{photograph}: --task {config.task} needs scenes or linear .exr pictures, not photographs"
        )


def scene_config(config: GenerateConfig) -> SceneConfig:
    """`config.scene` with the motion that the task needs, where it has none: a shutter time, or a burst."""
    scene, motion = config.scene, config.scene.motion
    if config.task == "deblur" and motion.exposure_s[1] == 0:
        share = motion.moving_share or MOVING_SHARE
        apart_s = max(motion.interval_s, SHUTTER_S[1])  # no frame follows, which could not begin before
        motion = replace(motion, interval_s=apart_s, exposure_s=SHUTTER_S, moving_share=share)
        return replace(scene, motion=motion)
    if config.task == "burst" and motion.frames == 1:
        try:
            return replace(scene, motion=replace(motion, frames=BURST_FRAMES))
        except FsidError as error:  # a shutter time that is longer than the frames are apart
            raise FsidError(f"scene.motion.{error}") from None
    return scene


def views_of_scene(
    rng: np.random.Generator, config: GenerateConfig, scene: Scene, renderer: SceneRenderer
) -> Views:
    """The views of a scene through its first eye."""
    if config.task == "deblur":
        middle = replace(scene, cameras=(replace(scene.cameras[0], exposure_s=0.0),))
        return Views(renderer.radiance(middle), (renderer.radiance(scene),))
    if config.task == "burst":
        return _burst(scene, cast(FlowRenderer, renderer))  # `GenerateConfig` allows no other
    return views_of_light(rng, config, renderer.radiance(scene))


def views_of_light(rng: np.random.Generator, config: GenerateConfig, light: np.ndarray) -> Views:
    """The views of linear light (H, W, 3) alone, for a task that needs no motion."""
    if config.task == "super-resolution":
        return smaller(rng, light, config.scale)
    return Views(light, (light,))


def smaller(rng: np.random.Generator, truth: np.ndarray, scale: int) -> Views:
    """Super-resolution: `truth` (H, W, 3), linear, as a lens and `scale` times larger pixels see it.

    Rows and columns beyond a multiple of 2 * scale are dropped.
    """
    height, width = (size // (2 * scale) * 2 * scale for size in truth.shape[:2])
    truth = truth[:height, :width]
    sigma_px = [float(sigma) for sigma in rng.uniform(*PSF_SIGMA_PX, size=2)]
    blurred = gaussian_filter(truth, [*(sigma * scale for sigma in sigma_px), 0], mode="nearest")
    small = blurred.reshape(height // scale, scale, width // scale, scale, 3).mean((1, 3), dtype=np.float32)
    return Views(truth, (small,), scale=scale, facts={"scale": scale, "psf_sigma_px": sigma_px})


def _burst(scene: Scene, renderer: FlowRenderer) -> Views:
    eye = scene.cameras[0].eye
    frames = [number for number, camera in enumerate(scene.cameras) if camera.eye == eye]
    frames.sort(key=lambda number: scene.cameras[number].frame)
    truth = renderer.radiance(scene, frames[0])
    others = [renderer.render(scene, number, flow_to=frames[0]) for number in frames[1:]]
    flow = tuple(frame.flow for frame in others if frame.flow is not None)
    return Views(truth, (truth, *(frame.radiance for frame in others)), flow)
