"""What a command asks for and would not get is refused, so that nobody trains on other data than was meant.

Only what is given one by one counts, `--set` and options: a file states many settings that have no effect, as
every dataset's own config.yaml does.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from fsid.config import to_plain
from fsid.dataset.config import RENDERED, GenerateConfig
from fsid.dataset.tasks import scene_config
from fsid.errors import FsidError
from fsid.scene import MotionConfig

_MOTION = "scene.motion."
_RASTER = ("quality", "supersampling", "lens_images")
_BURST = {"frames", "interval_s"}


def check_given(config: GenerateConfig, keys: Iterable[str]) -> None:
    """FsidError that names the first of `keys`, as `given_keys` lists them, that `config` does not follow."""
    idle = dict(_idle(config))
    for key in keys:
        if why := idle.get(key.partition(".")[0]) or idle.get(key):
            raise FsidError(f"{key}: has no effect {why}; leave it out")
        if key.startswith(_MOTION):
            _check_motion(config, key.removeprefix(_MOTION))


def _idle(config: GenerateConfig) -> Iterator[tuple[str, str]]:
    """The settings, or groups of them, that change nothing in the data of `config`, and why."""
    if config.images:
        yield from ((key, "on pictures (--images)") for key in (*RENDERED, "checks.duplicate_bits"))
    if config.renderer != "raster":
        yield from ((key, f"on --renderer {config.renderer}") for key in _RASTER)
    if config.task != "super-resolution":
        yield "scale", f"on --task {config.task}, only on super-resolution"
    motion, default = scene_config(config).motion, MotionConfig()
    changed = {name for name, value in vars(motion).items() if value != getattr(default, name)}
    if config.task != "burst":
        alone = f"on --task {config.task}, only on burst"
        yield from ((_MOTION + name, alone) for name in changed & _BURST)
        if motion.exposure_s[1] == 0:
            still = f"on --task {config.task} while the shutter is open for no time ({_MOTION}exposure_s)"
            yield from ((_MOTION + name, still) for name in changed - _BURST)


def _check_motion(config: GenerateConfig, name: str) -> None:
    """The motion that a task brings along where there is none must not replace what was asked for."""
    asked, taken = (to_plain(scene.motion)[name] for scene in (config.scene, scene_config(config)))
    if asked != taken:
        needed = "exposure_s above 0" if config.task == "deblur" else "frames above 1"
        raise FsidError(
            f"{_MOTION}{name}: --task {config.task} would take {taken} instead of {asked}; "
            f"give {_MOTION}{needed}, and all motion is as you set it"
        )
