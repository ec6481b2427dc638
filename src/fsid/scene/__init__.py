"""config + seed -> Scene: pure data, a few kilobytes of JSON, no pixels."""

from fsid.scene.config import SceneConfig
from fsid.scene.model import Background, Camera, Light, Material, Object, Scene, Transform, Vec3
from fsid.scene.sampler import SURFACES, VARIANTS, sample
from fsid.scene.serialise import scene_from_json, scene_to_json

__all__ = [
    "SURFACES",
    "VARIANTS",
    "Background",
    "Camera",
    "Light",
    "Material",
    "Object",
    "Scene",
    "SceneConfig",
    "Transform",
    "Vec3",
    "sample",
    "scene_from_json",
    "scene_to_json",
]
