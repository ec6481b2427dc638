"""The camera: clean light to the RAW file that a named camera would have stored, and back to a picture."""

from fsid.sensor.bare import Layout, raw_from_dn, read_mosaic
from fsid.sensor.blind import NoiseEstimate, estimate_noise
from fsid.sensor.calibrate import NoiseFit, fit_noise
from fsid.sensor.camera_fit import Calibration, calibrate
from fsid.sensor.camera_profile import CameraProfile
from fsid.sensor.colour import camera_to_srgb_matrix, colour_rand, srgb_to_camera_matrix
from fsid.sensor.demosaic import demosaic
from fsid.sensor.develop import develop, develop_linear, upright
from fsid.sensor.dng import dng_pixel_offset, read_raw, write_dng
from fsid.sensor.exposure import expose, exposure_rand
from fsid.sensor.fitted_profile import profile_of
from fsid.sensor.hot_pixels import hot_pixels, without_hot_pixels
from fsid.sensor.light import LightLevel, light_level
from fsid.sensor.mosaic import bayer_crop, mosaic, pack, unpack
from fsid.sensor.noise import add_noise, level_rand, variance
from fsid.sensor.pairs import clean_from_frame, clean_from_linear, clean_from_photo, noisy_from_clean
from fsid.sensor.profiles import (
    far_extrapolated,
    load_bayer_profile,
    load_profile,
    profile_names,
    save_profile,
)
from fsid.sensor.quantise import clean_levels, exact_levels, from_dn, quantise, to_dn
from fsid.sensor.raw import CFA_PATTERNS, NoiseLevel, Raw
from fsid.sensor.temporal import TemporalStatistics
from fsid.sensor.terms import NoiseTerms, add_noise_terms
from fsid.sensor.tone import srgb_decode, srgb_encode
from fsid.sensor.unprocess import linear_to_camera, process, unprocess

__all__ = [
    "CFA_PATTERNS",
    "Calibration",
    "CameraProfile",
    "Layout",
    "LightLevel",
    "NoiseEstimate",
    "NoiseFit",
    "NoiseLevel",
    "NoiseTerms",
    "Raw",
    "TemporalStatistics",
    "add_noise",
    "add_noise_terms",
    "bayer_crop",
    "calibrate",
    "camera_to_srgb_matrix",
    "clean_from_frame",
    "clean_from_linear",
    "clean_from_photo",
    "clean_levels",
    "colour_rand",
    "demosaic",
    "develop",
    "develop_linear",
    "dng_pixel_offset",
    "estimate_noise",
    "exact_levels",
    "expose",
    "exposure_rand",
    "far_extrapolated",
    "fit_noise",
    "from_dn",
    "hot_pixels",
    "level_rand",
    "light_level",
    "linear_to_camera",
    "load_bayer_profile",
    "load_profile",
    "mosaic",
    "noisy_from_clean",
    "pack",
    "process",
    "profile_names",
    "profile_of",
    "quantise",
    "raw_from_dn",
    "read_mosaic",
    "read_raw",
    "save_profile",
    "srgb_decode",
    "srgb_encode",
    "srgb_to_camera_matrix",
    "to_dn",
    "unpack",
    "unprocess",
    "upright",
    "variance",
    "without_hot_pixels",
    "write_dng",
]
