"""fsid scene: one scene as a file."""

from __future__ import annotations

from pathlib import Path

from tyro.conf import Positional

from fsid.cli.arguments import Output
from fsid.cli.generate import Variant
from fsid.config import load_settings
from fsid.errors import FsidError
from fsid.files import write_atomically


def scene(
    seed: Positional[int],
    *,
    output: Output,
    config: Path | None = None,
    set: tuple[str, ...] = (),
    width: int = 1920,
    height: int = 1080,
    variant: Variant = "full",
    texture_size: int = 512,
) -> None:
    """Write the scene of a seed: .json for FSID, .glb (glTF 2.0) for Blender and any other engine.

    Args:
        seed: Seed of the scene ("seed" inside a sample's KEY.json under "scene").
        output: File to write, .json or .glb.
        config: YAML file of settings, as for fsid generate.
        set: Single settings, key=value.
        width: Width of the camera's image in pixels.
        height: Height of the camera's image in pixels.
        variant: What varies between scenes.
        texture_size: Pixels per side of a texture tile in a .glb, a power of two.
    """
    from fsid.dataset import GenerateConfig
    from fsid.render.gltf import write_glb
    from fsid.scene import sample, scene_to_json

    suffix = output.suffix.lower()
    if suffix not in (".json", ".glb"):
        raise FsidError(f"{output}: scenes are written as .json or .glb")
    settings = load_settings(
        GenerateConfig, config, [*set, f"width={width}", f"height={height}", f"variant={variant}"]
    )
    chosen = sample(settings.scene, seed, width=width, height=height, variant=variant)
    if suffix == ".glb":
        write_glb(output, chosen, texture_size=texture_size)
    else:
        write_atomically(output, scene_to_json(chosen).encode())
