"""The camera: clean light to the RAW file that a named camera would have stored, and back to a picture."""

from fsid.sensor.mosaic import bayer_crop, bayer_flip, mosaic, pack, unpack
from fsid.sensor.noise import add_noise, level_rand, variance
from fsid.sensor.profiles import CameraProfile, load_profile, profile_names
from fsid.sensor.raw import CFA_PATTERNS, NoiseLevel, Raw

__all__ = [
    "CFA_PATTERNS",
    "CameraProfile",
    "NoiseLevel",
    "Raw",
    "add_noise",
    "bayer_crop",
    "bayer_flip",
    "level_rand",
    "load_profile",
    "mosaic",
    "pack",
    "profile_names",
    "unpack",
    "variance",
]
