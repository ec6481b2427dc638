"""config + seed -> Scene: pure data, a few kilobytes of JSON, no pixels."""

from fsid.scene.camera_config import CameraConfig, LensConfig, MotionConfig, RigConfig
from fsid.scene.config import BackgroundConfig, LightConfig, MaterialConfig, PlacementConfig, SceneConfig
from fsid.scene.model import (
    Background,
    Camera,
    Distortion,
    Light,
    Material,
    Motion,
    Object,
    Scene,
    Sky,
    Transform,
    Vec3,
)
from fsid.scene.sampler import VARIANTS, sample
from fsid.scene.serialise import scene_from_json, scene_to_json

__all__ = [
    "VARIANTS",
    "Background",
    "BackgroundConfig",
    "Camera",
    "CameraConfig",
    "Distortion",
    "LensConfig",
    "Light",
    "LightConfig",
    "Material",
    "MaterialConfig",
    "Motion",
    "MotionConfig",
    "Object",
    "PlacementConfig",
    "RigConfig",
    "Scene",
    "SceneConfig",
    "Sky",
    "Transform",
    "Vec3",
    "sample",
    "scene_from_json",
    "scene_to_json",
]
