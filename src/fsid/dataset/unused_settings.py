"""Settings that have no effect are refused, so that nobody trains on other data than was meant.

Only settings that are given one by one count, by `--set` and options: a file states many that have no effect,
as every dataset's own config.yaml does.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import fields, replace
from operator import attrgetter

from fsid.config import to_plain
from fsid.dataset.config import RENDERED, GenerateConfig
from fsid.dataset.tasks import scene_config
from fsid.errors import FsidError
from fsid.scene import MotionConfig, PlacementConfig

_FOLLOWED = {
    "preview": ("width", "height", "images", "task", "cameras", "checks", *RENDERED),
    "scene": ("width", "height", "task", "variant", "scene"),
}
"""The settings that commands beside `fsid generate` follow."""
_NEEDS = {
    "scene.mesh_folders": ("scene.mesh_folder_share", "scene.mesh_folders_cc0_only"),
    "scene.texture_folders": ("scene.texture_folder_share",),
    "scene.hdri_folder": ("scene.hdri_share",),
    "scene.placement.far_share": ("scene.placement.far_factor",),
    "scene.lights.sun_share": ("scene.lights.sun_to_sky",),
    "scene.camera.skyward_share": ("scene.camera.skyward",),
    "scene.rig.eyes": ("scene.rig.baseline_m", "scene.rig.convergence"),
    "scene.motion.moving_share": ("scene.motion.speed_m_s", "scene.motion.spin_deg_s"),
    "scene.lens.distortion_share": ("scene.lens.distortion",),
    "scene.lens.blur_share": ("scene.lens.aperture_m", "scene.lens.focus", "lens_images"),
    "scene.lens.vignetting_share": ("scene.lens.vignetting",),
    "scene.lens.fringe_share": ("scene.lens.fringe",),
    "scene.lens.soft_share": ("scene.lens.softness_px",),
    "scene.lens.sharp_share": ("scene.lens.sharpening",),
}
"""A setting, and those that change nothing while it is 0 or empty, or there is one eye."""
_PLACING = {f"scene.placement.{key.name}" for key in fields(PlacementConfig) if key.name != "spread_m"}
_FINISH = {f"scene.materials.{key}_share" for key in ("cast", "lobe", "coat", "emission")}
_FIXED: dict[str, set[str]] = {
    "objects": _PLACING | _FINISH | {"scene.materials.tile_scale"},
    "materials": _PLACING | {"scene.nature_share"},
    "objects-materials": _PLACING,
    "full": set(),
}
"""Settings of what a variant does not vary."""
_MOTION = "scene.motion."
_RASTER = ("quality", "supersampling", "lens_images")
_BURST = {"frames", "interval_s"}


def check_given(config: GenerateConfig, keys: Iterable[str], command: str = "generate") -> None:
    """FsidError that names the first of `keys`, as `given_keys` lists them, that `fsid command` of `config`
    does not follow. command: generate, preview or scene."""
    idle = dict(_idle(config, command))
    for key in keys:
        if why := idle.get(key.partition(".")[0]) or idle.get(key):
            raise FsidError(f"{key}: has no effect {why}; leave it out")
        if key.startswith(_MOTION):
            _check_motion(config, key.removeprefix(_MOTION))


def _idle(config: GenerateConfig, command: str) -> Iterator[tuple[str, str]]:
    """The settings, or groups of them, that change nothing in what is made of `config`, and why."""
    moved = replace(config, scene=scene_config(config))
    for needed, keys in _NEEDS.items():
        value = attrgetter(needed)(moved)
        if value == (1 if needed == "scene.rig.eyes" else type(value)()):
            yield from ((key, f"while {needed} is {to_plain(value)!r}") for key in keys)
    yield from ((key, f"on --variant {config.variant}") for key in _FIXED[config.variant])
    yield from _idle_motion(moved, command)
    if command != "scene":
        yield from _idle_in_pairs(config)
    if command in _FOLLOWED:
        others = {field.name for field in fields(config)} - {*_FOLLOWED[command]}
        yield from ((key, f"on fsid {command}") for key in others)


def _idle_motion(config: GenerateConfig, command: str) -> Iterator[tuple[str, str]]:
    """Those of motion where no time passes; `fsid scene` has all frames, whatever the task."""
    motion, default = config.scene.motion, MotionConfig()
    changed = {name for name, value in vars(motion).items() if value != getattr(default, name)}
    has_frames = config.task == "burst" or command == "scene"
    if not has_frames:
        alone = f"on --task {config.task}, only on burst"
        yield from ((_MOTION + name, alone) for name in changed & _BURST)
    if motion.exposure_s[1] == 0 and not (has_frames and motion.frames > 1):
        what = "one frame" if has_frames else f"--task {config.task}"
        still = f"on {what} while the shutter is open for no time ({_MOTION}exposure_s)"
        yield from ((_MOTION + name, still) for name in changed - _BURST)


def _idle_in_pairs(config: GenerateConfig) -> Iterator[tuple[str, str]]:
    """Those that pairs of this source, renderer and task make no use of."""
    if config.images:
        yield from ((key, "on pictures (--images)") for key in (*RENDERED, "checks.duplicate_bits"))
    if config.renderer != "raster":
        yield from ((key, f"on --renderer {config.renderer}") for key in _RASTER)
    if config.task != "super-resolution":
        yield "scale", f"on --task {config.task}, only on super-resolution"


def _check_motion(config: GenerateConfig, name: str) -> None:
    """The motion that a task brings along where there is none must not replace what was asked for."""
    asked, taken = (to_plain(scene.motion)[name] for scene in (config.scene, scene_config(config)))
    if asked != taken:
        needed = "exposure_s above 0" if config.task == "deblur" else "frames above 1"
        raise FsidError(
            f"{_MOTION}{name}: --task {config.task} would take {taken} instead of {asked}; "
            f"give {_MOTION}{needed}, and all motion is as you set it"
        )
