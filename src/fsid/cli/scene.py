"""fsid scene: one scene as a file."""

from __future__ import annotations

from pathlib import Path

from tyro.conf import Positional

from fsid.cli.arguments import Output
from fsid.cli.generate import Variant
from fsid.config import load_settings
from fsid.errors import FsidError


def scene(
    seed: Positional[int],
    *,
    output: Output,
    config: Path | None = None,
    set: tuple[str, ...] = (),
    width: int = 1920,
    height: int = 1080,
    variant: Variant = "full",
) -> None:
    """Write the scene of a seed as JSON: objects, materials, transforms, background, lights and camera.

    Args:
        seed: Seed of the scene ("seed" inside a sample's KEY.json under "scene").
        output: File to write, .json.
        config: YAML file of settings, as for fsid generate.
        set: Single settings, key=value.
        width: Width of the camera's image in pixels.
        height: Height of the camera's image in pixels.
        variant: What varies between scenes.
    """
    from fsid.dataset import GenerateConfig
    from fsid.scene import sample, scene_to_json

    if output.suffix.lower() != ".json":
        raise FsidError(f"{output}: scenes are written as .json")
    settings = load_settings(
        GenerateConfig, config, [*set, f"width={width}", f"height={height}", f"variant={variant}"]
    )
    text = scene_to_json(sample(settings.scene, seed, width=width, height=height, variant=variant))
    try:
        output.write_text(text, encoding="utf-8")
    except OSError as error:
        raise FsidError(f"{output}: cannot be written ({error.strerror})") from None
