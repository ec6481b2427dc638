"""From fitted lines to a profile: DN to normalised units, one line per ISO.

k = k_dn / span,      sigma2 = sigma2_dn / span^2,      span = white - black
"""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.calibrate import NoiseFit
from fsid.sensor.camera_profile import MONO, CameraProfile, Measurement
from fsid.sensor.colour import published_matrices
from fsid.sensor.quantise import ROUNDING_DN2, check_levels

_METHOD = "fsid calibrate: weighted line through pooled temporal variances per CFA site (sensor/calibrate.py)"


def profile_of(
    fits: Mapping[float, NoiseFit],
    *,
    name: str,
    cfa: str | None,
    white_level: int,
    black_level: int | None = None,
    xyz_to_camera: np.ndarray | None = None,
    camera: str = "unknown",
    frames: Mapping[float, int] | None = None,
    dark_frames: Mapping[float, int] | None = None,
    date: str = "",
    notes: str = "",
) -> CameraProfile:
    """The profile `name` of the lines that `fit_noise` found, by ISO, for frames that no file holds.

    cfa: None or "MONO" for a monochrome sensor. black_level: DN, None for the mean of `site_blacks`.
    xyz_to_camera: (3, 3) of D65, None for the published ones of other cameras. frames, dark_frames: how many
    the lines are from, by ISO; 0 where not stated. FsidError: no fit, an ISO that is none, or a white level
    not above the black level.
    """
    isos, white_level = sorted(fits), operator.index(white_level)
    if not isos or not all(0 < iso < math.inf for iso in isos):
        raise FsidError(f"a profile needs fits by ISO, numbers above 0; got {isos}")
    each = [fits[iso] for iso in isos]
    found = site_blacks(np.array([fit.black for fit in each]), np.array([fit.sigma2_dn for fit in each]))
    black = round(float(found.mean())) if black_level is None else black_level
    check_levels(black, white_level, f"profile {name}")
    span = white_level - black

    def table(values: list[np.ndarray]) -> np.ndarray:
        return np.array([np.broadcast_to(v, 4) for v in values])

    return CameraProfile(
        name=name,
        camera=camera,
        cfa=cfa or MONO,
        black_level=black,
        white_level=white_level,
        bits=white_level.bit_length(),
        iso=tuple(isos),
        k=table([fit.k_dn for fit in each]) / span,
        sigma2=table([fit.sigma2_dn for fit in each]) / span**2,
        xyz_to_camera=published_matrices() if xyz_to_camera is None else xyz_to_camera[None],
        source=_METHOD,
        notes=notes,
        date=date,
        measured=Measurement(
            k_error=table([fit.k_dn_error for fit in each]) / span,
            sigma2_error=table([fit.sigma2_dn_error for fit in each]) / span**2,
            black=table([fit.black for fit in each]),
            frames=tuple((frames or {}).get(iso, 0) for iso in isos),
            dark_frames=tuple((dark_frames or {}).get(iso, 0) for iso in isos),
        ),
    )


def site_blacks(black: np.ndarray, sigma2_dn: np.ndarray) -> np.ndarray:
    """(sites,) DN: black levels (n, sites) of n ISOs, averaged by what noise sigma2_dn (n, sites) leaves."""
    noise_dn2 = np.maximum(np.mean(sigma2_dn, axis=1), ROUNDING_DN2)
    return np.asarray(np.average(black, axis=0, weights=1 / noise_dn2))
