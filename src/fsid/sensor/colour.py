"""Camera colour: what the sensor's filters make of sRGB light, and what white balance makes of that.

    rgb_srgb = N(M_xyz_to_camera @ M_srgb_to_xyz)^-1 @ (white_balance * rgb_camera)

N scales each row to the sum 1 (Brooks et al. 2019, section 3.3), so that white-balanced grey is sRGB grey
whatever the matrix and the gains. The camera's response to the light's colour then sits in the gains alone.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
import yaml

from fsid.errors import FsidError
from fsid.sensor.arrays import check_floating, check_generator, like

# IEC 61966-2-1, linear sRGB -> XYZ, D65, the rounding that Brooks et al. use.
SRGB_TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)

RED_GAIN_RANGE = (1.9, 2.4)  # Brooks et al. 2019, section 3.4
BLUE_GAIN_RANGE = (1.5, 1.9)

_MAX_CONDITION = 1e6  # of a matrix that can still be inverted in single precision; of cameras it is below 10


@cache
def published_matrices() -> np.ndarray:
    """(4, 3, 3) float64 XYZ -> camera matrices of Brooks et al. 2019 (see colour.yaml); read-only."""
    text = (files("fsid.sensor") / "colour.yaml").read_text(encoding="utf-8")
    matrices = np.array(yaml.safe_load(text)["xyz_to_camera"])
    matrices.setflags(write=False)
    return matrices


def srgb_to_camera_matrix(xyz_to_camera: np.ndarray) -> np.ndarray:
    """(3, 3) float64 linear sRGB -> white-balanced camera RGB, rows summing to 1."""
    matrix = np.asarray(xyz_to_camera, np.float64) @ SRGB_TO_XYZ
    return matrix / matrix.sum(axis=1, keepdims=True)


def camera_to_srgb_matrix(xyz_to_camera: np.ndarray) -> np.ndarray:
    """(3, 3) float64 white-balanced camera RGB -> linear sRGB (the CCM), rows summing to 1.

    FsidError unless `is_of_camera`.
    """
    if not is_of_camera(np.asarray(xyz_to_camera, np.float64)):
        raise FsidError(
            f"xyz_to_camera {np.round(xyz_to_camera, 4).tolist()}: no camera sees colours like that"
        )
    return np.linalg.inv(srgb_to_camera_matrix(xyz_to_camera))


def is_of_camera(xyz_to_camera: np.ndarray) -> bool:
    """Whether matrices (..., 3, 3) are finite, have an inverse, and see light where there is white."""
    with np.errstate(all="ignore"):
        matrix = xyz_to_camera @ SRGB_TO_XYZ
    if not (np.isfinite(matrix).all() and (matrix.sum(axis=-1) > 0).all()):
        return False
    return bool((np.linalg.cond(matrix) < _MAX_CONDITION).all())


def colour_rand(
    rng: np.random.Generator, xyz_to_camera: np.ndarray
) -> tuple[np.ndarray, tuple[float, float, float]]:
    """Draw (XYZ -> camera matrix (3, 3), white-balance gains (r, 1, b)).

    The matrix is a random convex blend of `xyz_to_camera` (m, 3, 3), the gains are uniform over
    `RED_GAIN_RANGE` and `BLUE_GAIN_RANGE` (Brooks et al. 2019). Brightness is not drawn here; see `exposure`.
    FsidError for matrices of another shape, such as a single one: give [matrix].
    """
    check_generator(rng)
    if np.shape(xyz_to_camera)[1:] != (3, 3):
        raise FsidError(f"xyz_to_camera has shape {np.shape(xyz_to_camera)}; expected (m, 3, 3)")
    weights = rng.uniform(size=len(xyz_to_camera))
    blend = np.tensordot(weights / weights.sum(), xyz_to_camera, axes=1)
    return blend, (float(rng.uniform(*RED_GAIN_RANGE)), 1.0, float(rng.uniform(*BLUE_GAIN_RANGE)))


def apply_matrix(matrix: np.ndarray, rgb: Any) -> Any:
    """matrix (3, 3) times every pixel of rgb (..., 3), array or tensor, in float32. FsidError: integers."""
    check_floating(rgb, "colour")
    rgb = rgb.astype(np.float32, copy=False) if isinstance(rgb, np.ndarray) else rgb.float()
    return rgb @ like(matrix.T, rgb)
