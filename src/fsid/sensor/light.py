"""From lux to electrons, exposure time and ISO: what a camera makes of "0.5 lux".

    E_sensor  = E rho T / (4 N^2)                            lux on the sensor, thin lens far from the subject
    electrons = E_sensor q pitch^2 QE t,   q = 1.115e16      photons of 400-700 nm per lux, m^2 and second
    signal    = electrons k(ISO)                             because Var = k x makes k the x of one electron

Auto-exposure: the signal of a mid-grey (rho = 0.18) is to be `KEY` of saturation. Time grows first, up to the
longest that hand and subject allow, then ISO, up to the camera's limit; what is missing then, the picture is
too dark. The ISO thus follows from the profile's own k and not from a manufacturer's speed rating.

Assumptions, all replaceable: light of the spectrum of daylight (54 lux per micromole of 400-700 nm photons
and second; tungsten has more photons per lux), QE 0.28 as the mean over 400-700 nm of a green pixel behind
its filter, lens transmittance 0.9, no vignetting, no flare. Each may be wrong by a third of a stop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fsid.errors import FsidError
from fsid.sensor.camera_profile import CameraProfile

PHOTONS_PER_LUX_M2_S = 6.02214e23 * 1e-6 / 54
GREY = 0.18
KEY = 0.12  # half a stop below the 18 % that puts white on saturation: room for highlights
LONGEST_EXPOSURE_S = 0.1
SHORTEST_EXPOSURE_S = 1e-5
BEYOND_TABLE = 4.0  # a camera's highest ISO, in highest ISOs of its profile, where it is not given
_HALVINGS = 60


@dataclass(frozen=True)
class LightLevel:
    """What the camera sets and gets. electrons: of a mid-grey at a green pixel. signal: the same as x, `KEY`
    unless the light is too low for the highest ISO (or too bright).
    """

    lux: float
    exposure_s: float
    iso: float
    electrons: float
    signal: float


def light_level(
    profile: CameraProfile,
    lux: float,
    *,
    longest_exposure_s: float = LONGEST_EXPOSURE_S,
    highest_iso: float | None = None,
    reflectance: float = GREY,
) -> LightLevel:
    """Auto-exposure of the camera in a scene of `lux`.

    FsidError: as `electrons_per_second`, a time of 0 and less, a highest ISO below the lowest of the profile.
    """
    rate = electrons_per_second(profile, lux, reflectance)
    if not longest_exposure_s > 0:
        raise FsidError(f"longest_exposure_s {longest_exposure_s}: must be above 0")
    lowest = min(profile.iso)
    highest = BEYOND_TABLE * max(profile.iso) if highest_iso is None else highest_iso
    if not highest >= lowest:
        raise FsidError(
            f"highest_iso {highest}: must be at least {lowest:g}, the lowest ISO of profile {profile.name}"
        )
    time = min(max(KEY / _gain(profile, lowest) / rate, SHORTEST_EXPOSURE_S), longest_exposure_s)
    electrons = rate * time
    iso = _iso_of_gain(profile, KEY / electrons, lowest, highest)
    return LightLevel(lux, time, iso, electrons, electrons * _gain(profile, iso))


def electrons_per_second(profile: CameraProfile, lux: float, reflectance: float = GREY) -> float:
    """At a green pixel that sees a surface of `reflectance` in `lux`.

    FsidError: no optics in the profile, lux or reflectance not finite and above 0.
    """
    optics = profile.optics
    if optics is None:
        raise FsidError(
            f"profile {profile.name}: has no optics; add `optics: {{f_number: ..., pixel_pitch_um: ...}}`"
        )
    if not (0 < lux < math.inf and 0 < reflectance < math.inf):
        raise FsidError(f"light of {lux} lux, reflectance {reflectance}: both must be finite and above 0")
    on_sensor = lux * reflectance * optics.transmittance / (4 * optics.f_number**2)
    area_m2 = (optics.pixel_pitch_um * 1e-6) ** 2
    return on_sensor * PHOTONS_PER_LUX_M2_S * area_m2 * optics.quantum_efficiency


def _gain(profile: CameraProfile, iso: float) -> float:
    """x of one electron at a green pixel."""
    k = profile.curves[0](iso)
    return float(k[1] + k[2]) / 2


def _iso_of_gain(profile: CameraProfile, gain: float, low: float, high: float) -> float:
    """The ISO in low..high whose gain is nearest to `gain`; k rises with ISO, at last in proportion."""
    high = min(high, 1e9)
    for _ in range(_HALVINGS):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if _gain(profile, middle) < gain else (low, middle)
    return high
