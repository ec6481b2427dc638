"""The light of pixels whose noise the camera clips: at DN 0, and counted down from it at the white level.

    m = E max(y, 0) = tau (u Phi(u) + phi(u)),      v = Var max(y, 0),      y ~ N(u tau, tau^2)

Less than a few sigma above DN 0 the mean over frames is too bright, however many there are (below white too
dark). v / m^2 falls as u rises: mean and variance of a neighbourhood tell its u, and with it tau (a
censored normal distribution, Tobin 1958); its tau and the mean of a pixel tell that pixel's own u. Rounding
adds 1/12 DN^2 to the variance of what is not cut off; it hides noise below one DN, which is left as it is.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from fsid.sensor.quantise import ROUNDING_DN2

_LEAST_TAU_DN = 1.0
_REACH = 4.5  # sigmas from the limit, from which on no noise is cut off
_U = np.linspace(-1.0, 8.0, 1801)  # light is never below black; how far it is above white nothing shows
_SHARE = ndtr(_U)  # that is not cut off
_MEAN = _U * _SHARE + np.exp(-_U * _U / 2) / np.sqrt(2 * np.pi)
_RATIO = (_U * _MEAN + _SHARE) / _MEAN**2 - 1  # of the variance to the squared mean
_PASSES = 3


def unclipped(dn: np.ndarray, near_dn: np.ndarray, near_dn2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(mu of every pixel in DN, d mu / d mean) from its mean over frames `dn`, all (H, W), counted up from
    DN 0, or down from white.

    near_dn, near_dn2: mean and variance over frames of a pixel's neighbourhood. mu may lie below 0.
    """
    light_dn, slope = dn.copy(), np.ones_like(dn)
    is_near = near_dn < _REACH * np.sqrt(near_dn2)
    dn, near_dn, near_dn2 = dn[is_near], np.maximum(near_dn[is_near], 1e-6), near_dn2[is_near]
    share = np.ones_like(dn)
    for _ in range(_PASSES):
        ratio = np.maximum(near_dn2 - share * ROUNDING_DN2, 0) / near_dn**2
        u = np.interp(-ratio, -_RATIO, _U)
        share = np.interp(u, _U, _SHARE)
    tau = near_dn / np.interp(u, _U, _MEAN)
    own = np.interp(dn / tau, _MEAN, _U)
    is_cut = (own < _REACH) & (tau > _LEAST_TAU_DN)
    light_dn[is_near] = np.where(is_cut, own * tau, dn)
    slope[is_near] = np.where(is_cut, 1 / np.interp(own, _U, _SHARE), 1.0)
    return light_dn, slope
