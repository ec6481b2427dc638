"""fsid scene: one scene as a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from fsid.cli.arguments import Output, Settings, overrides
from fsid.cli.generate import Variant
from fsid.errors import FsidError
from fsid.files import write_atomically


def scene(
    seed: Annotated[Positional[int], arg(metavar="SEED")],
    *,
    output: Output,
    config: Path | None = None,
    set: Settings = (),
    width: int | None = None,
    height: int | None = None,
    variant: Variant | None = None,
    texture_size: int | None = None,
) -> None:
    """Write the scene of a seed: .json for FSID, .glb (glTF 2.0) for Blender and any other engine.

    Args:
        seed: Seed of the scene ("seed" inside a sample's KEY.json under "scene").
        output: File to write, .json or .glb.
        config: YAML file of settings or the name of a built-in one, as for fsid generate.
        set: Single settings of the scene, key=value.
        width: Width of the camera's image in pixels (default 1920).
        height: Height of the camera's image in pixels (default 1080).
        variant: What varies between scenes (default full).
        texture_size: Pixels per side of a texture tile in a .glb, a power of two (default 512).
    """
    from fsid.config import given_keys
    from fsid.dataset import check_given, generate_config
    from fsid.dataset.tasks import scene_config
    from fsid.render.gltf import write_glb
    from fsid.scene import sample, scene_to_json

    suffix = output.suffix.lower()
    if suffix not in (".json", ".glb"):
        raise FsidError(f"{output}: scenes are written as .json or .glb")
    if texture_size is not None and suffix != ".glb":
        raise FsidError(f"--texture-size: {output} holds no textures; it is for a .glb")
    given = overrides(set, width=width, height=height, variant=variant)
    settings = generate_config(config, given)
    check_given(settings, given_keys(given), "scene")
    chosen = sample(
        scene_config(settings),
        seed,
        width=settings.width,
        height=settings.height,
        variant=settings.variant,
    )
    if suffix == ".glb":
        write_glb(output, chosen, texture_size=512 if texture_size is None else texture_size)
    else:
        write_atomically(output, scene_to_json(chosen).encode())
