"""What a command asks for and would not get is refused, so that nobody trains on other data than was meant.

Only what is given one by one counts, `--set` and options: a file states many settings that have no effect, as
every dataset's own config.yaml does.
"""

from __future__ import annotations

from collections.abc import Iterable

from fsid.config import to_plain
from fsid.dataset.config import GenerateConfig
from fsid.dataset.tasks import scene_config
from fsid.errors import FsidError

_MOTION = "scene.motion."


def check_given(config: GenerateConfig, keys: Iterable[str]) -> None:
    """FsidError that names the first of `keys`, as `given_keys` lists them, that `config` does not follow."""
    for key in keys:
        if key.startswith(_MOTION):
            _check_motion(config, key.removeprefix(_MOTION))


def _check_motion(config: GenerateConfig, name: str) -> None:
    """The motion that a task brings along where there is none must not replace what was asked for."""
    asked, taken = (to_plain(scene.motion)[name] for scene in (config.scene, scene_config(config)))
    if asked != taken:
        needed = "exposure_s above 0" if config.task == "deblur" else "frames above 1"
        raise FsidError(
            f"{_MOTION}{name}: --task {config.task} would take {taken} instead of {asked}; "
            f"give {_MOTION}{needed}, and all motion is as you set it"
        )
