"""A camera's noise, by name: `load_profile("pixel6").level(3200)`.

    Var(x) = k x + sigma2,      x = (DN - black) / span,      span = white - black

A profile is one YAML file: the camera's integers (CFA, bits, black and white level) and a list of levels,
each with `iso`, `k`, `sigma2` (normalised) and the same in DN (`k_dn = k span`, `sigma2_dn = sigma2 span^2`;
a file written by hand may leave these two out), four values per entry in the order R, Gr, Gb, B. A calibrated
one states errors, black level and number of frames beside them, and `law`, the line and the parabola through
all ISOs, which is there to be read by people: FSID computes it again. `terms` says what the camera does
beyond k and sigma2 (see `terms`); without it the model is the paper's. Own profiles work by path.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from functools import lru_cache
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.polynomial.polynomial import polyval

from fsid.config import to_plain
from fsid.errors import FsidError
from fsid.files import read_whole, write_atomically
from fsid.sensor.camera_profile import MONO, CameraProfile, Measurement, Optics
from fsid.sensor.colour import is_of_camera, published_matrices
from fsid.sensor.iso_law import k_law, sigma2_law
from fsid.sensor.mosaic import check_cfa
from fsid.sensor.quantise import ROUNDING_DN2
from fsid.sensor.terms import PAPER, NoiseTerms, parse_terms
from fsid.yaml_json import parse_yaml

_REQUIRED = {"name", "camera", "cfa", "bits", "black_level", "white_level", "levels"}
_OPTIONAL = {"source", "notes", "date", "xyz_to_camera", "law", "terms", "optics"}
_MEASURED = {"k_error", "sigma2_error", "black", "frames", "dark_frames"}
_OPTICS = {
    "f_number": (0.5, 64.0, ""),
    "pixel_pitch_um": (0.3, 50.0, " micrometres"),
    "quantum_efficiency": (0.001, 1.0, ", electrons per photon"),
    "transmittance": (0.001, 1.0, ", a share of the light"),
}
_LARGEST = 1e300  # of any number; beyond it are infinity and integers that are no float
_FAR = 4.5  # times: two stops, and what tables of nominal ISOs are short of them
_DN_TOLERANCE = 0.01  # k_dn and sigma2_dn repeat k and sigma2; they may differ by rounding only


def profile_names() -> tuple[str, ...]:
    """Names of the built-in profiles, sorted."""
    folder = files("fsid.sensor") / "profiles"
    return tuple(sorted(f.name.removesuffix(".yaml") for f in folder.iterdir() if f.name.endswith(".yaml")))


def load_profile(name_or_path: str | Path) -> CameraProfile:
    """A built-in profile by name, or a YAML file by path; FsidError names the file and key that is wrong.

    Its arrays are read-only: who loads the same file may get the same object.
    """
    if str(name_or_path) in profile_names():
        text = (files("fsid.sensor") / "profiles" / f"{name_or_path}.yaml").read_text(encoding="utf-8")
    else:
        text = _read(Path(name_or_path))
    return _parse(text, str(name_or_path))


def load_bayer_profile(name_or_path: str | Path) -> CameraProfile:
    """`load_profile` of a camera that makes mosaics; FsidError where it has no colour filters."""
    profile = load_profile(name_or_path)
    check_bayer(profile, str(name_or_path))
    return profile


def check_bayer(profile: CameraProfile, source: str) -> None:
    """FsidError, naming `source`, where the camera has no colour filters and so makes no mosaics."""
    if profile.cfa == MONO:
        raise FsidError(f"{source}: is of a sensor without colour filters; give a Bayer camera's profile")


def profiles_digest(names: Iterable[str | Path]) -> str:
    """16 hexadecimal digits of the noise, levels and colour in the files among `names`; "" where all are
    built in. A file may move, and what it says of its origin and optics may change."""
    own = [load_profile(name) for name in names if str(name) not in profile_names()]
    if not own:
        return ""
    facts = [(p.cfa, p.black_level, p.white_level, p.iso, _switched_on(p.terms)) for p in own]
    arrays = [(p.k, p.sigma2, p.xyz_to_camera, *_errors(p)) for p in own]
    numbers = [[array.tolist() for array in each] for each in arrays]
    return hashlib.sha256(repr((facts, numbers)).encode()).hexdigest()[:16]


def _errors(profile: CameraProfile) -> tuple[np.ndarray, ...]:
    """What decides, beside the levels, how they are interpolated."""
    measured = profile.measured
    return () if measured is None else (measured.k_error, measured.sigma2_error)


def far_extrapolated(names: Iterable[str | Path], iso_min: float, iso_max: float) -> Iterator[CameraProfile]:
    """Those profiles whose measured ISOs a range from `iso_min` to `iso_max` exceeds by more than two stops.

    So far the law beyond the table is believed (`iso_law`). FsidError as in `load_profile`.
    """
    for profile in map(load_profile, names):
        if iso_min < profile.iso[0] / _FAR or iso_max > profile.iso[-1] * _FAR:
            yield profile


def left_behind(path: Path, profile: CameraProfile) -> str:
    """What the profile at `path` has and `profile`, which is to replace it, lacks: optics, terms, a colour
    matrix of its own, ISOs; "" where that is nothing, or no profile is there."""
    try:
        old = load_profile(path)
    except FsidError:
        return ""
    new, published = _switched_on(profile.terms), published_matrices()
    found = ["optics"] if old.optics is not None and profile.optics is None else []
    found += [f"terms.{name}" for name in _switched_on(old.terms) if name not in new]
    own = not np.array_equal(old.xyz_to_camera, published)
    found += ["xyz_to_camera"] if own and np.array_equal(profile.xyz_to_camera, published) else []
    isos = [f"{iso:g}" for iso in old.iso if iso not in profile.iso]
    return ", ".join([*found, *([f"ISO {', '.join(isos)}"] if isos else [])])


def save_profile(path: str | Path, profile: CameraProfile) -> None:
    """Write `profile` as the YAML that `load_profile` reads, whole or not at all.

    FsidError for a profile that it would refuse.
    """
    write_atomically(Path(path), profile_file(profile))


def profile_file(profile: CameraProfile) -> bytes:
    """The content of the file that `save_profile` writes, numbers to 6 digits. Errors as there."""
    keys = ("name", "camera", "cfa", "bits", "black_level", "white_level", "date", "source", "notes")
    data = {key: getattr(profile, key) for key in keys}
    data |= {"xyz_to_camera": profile.xyz_to_camera.tolist()}
    if profile.terms != PAPER:
        data["terms"] = _switched_on(profile.terms)
    if profile.optics is not None:
        data["optics"] = asdict(profile.optics)
    if profile.measured is not None and len(profile.iso) > 1:
        data["law"] = _law(profile)
    data["levels"] = [_level(profile, row) for row in range(len(profile.iso))]
    text = yaml.safe_dump(to_plain(data), sort_keys=False, default_flow_style=None, width=110)
    _parse(text, f"profile {profile.name}")
    return text.encode()


def _switched_on(terms: NoiseTerms) -> dict[str, Any]:
    return {key: value for key, value in asdict(terms).items() if value != getattr(PAPER, key)}


def _level(profile: CameraProfile, row: int) -> dict[str, Any]:
    k, sigma2, span = profile.k[row], profile.sigma2[row], profile.span
    level = {
        "iso": profile.iso[row],
        "k": _rounded(k),
        "sigma2": _rounded(sigma2),
        "k_dn": _rounded(k * span),
        "sigma2_dn": _rounded(sigma2 * span**2),
    }
    if (measured := profile.measured) is not None:
        level |= {
            "k_error": _rounded(measured.k_error[row]),
            "sigma2_error": _rounded(measured.sigma2_error[row]),
            "black": _rounded(measured.black[row]),
            "frames": measured.frames[row],
            "dark_frames": measured.dark_frames[row],
        }
    return level


def _law(profile: CameraProfile) -> dict[str, Any]:
    """Coefficients per site in ascending order of ISO, and the largest relative departure of a level."""
    iso, floor = np.array(profile.iso), ROUNDING_DN2 / profile.span**2
    k = [k_law(iso, site) for site in profile.k.T]
    sigma2 = [sigma2_law(iso, site, floor, 0.0) for site in profile.sigma2.T]
    for coefficients in sigma2:
        coefficients[0] += floor
    return {
        "k": [_rounded(c) for c in k],
        "sigma2": [_rounded(c) for c in sigma2],
        "k_departure": _departure(iso, k, profile.k),
        "sigma2_departure": _departure(iso, sigma2, profile.sigma2),
    }


def _departure(iso: np.ndarray, coefficients: list[np.ndarray], values: np.ndarray) -> float:
    law = np.stack([polyval(iso, c) for c in coefficients], axis=1)
    return float(f"{np.max(np.abs(values / law - 1)):.3g}")


def _rounded(values: np.ndarray) -> list[float]:
    return [float(f"{value:.6g}") for value in values]


def _read(path: Path) -> str:
    if not os.path.isfile(path):  # unlike Path.is_file, False for a name that is too long, too
        names = ", ".join(profile_names())
        raise FsidError(f"profile {str(path)!r} is neither a file nor one of the built-in profiles: {names}")
    try:
        return read_whole(path).decode()
    except UnicodeDecodeError as error:
        raise FsidError(f"{path}: cannot read this profile as text: {error}") from error


@lru_cache(maxsize=64)
def _parse(text: str, where: str) -> CameraProfile:
    """Kept, since every frame of a dataset asks for one; a file that has changed is another text."""
    data = parse_yaml(text, where)
    _check_keys(data, where, _REQUIRED, _OPTIONAL)
    white = _integer(data, "white_level", where, 1, 65535)
    black = _integer(data, "black_level", where, 0, white - 1)
    bits = _integer(data, "bits", where, 1, 16)
    if white >= 2**bits:
        raise FsidError(f"{where}: white_level {white} does not fit into {bits} bits")
    iso, k, sigma2 = _levels(data["levels"], where, white - black)
    matrices, measured = _matrices(data, where), _measurement(data["levels"], where)
    errors = () if measured is None else (measured.k_error, measured.sigma2_error, measured.black)
    for array in (k, sigma2, matrices, *errors):
        array.setflags(write=False)
    cfa = data["cfa"] if data["cfa"] == MONO else check_cfa(data["cfa"], f"{where}: cfa")
    return CameraProfile(
        name=str(data["name"]),
        camera=str(data["camera"]),
        cfa=cfa,
        black_level=black,
        white_level=white,
        bits=bits,
        iso=iso,
        k=k,
        sigma2=sigma2,
        xyz_to_camera=matrices,
        source=str(data.get("source", "")),
        notes=str(data.get("notes", "")),
        date=str(data.get("date", "")),
        measured=measured,
        terms=parse_terms(data.get("terms", {}), f"{where}: terms"),
        optics=_optics(data["optics"], f"{where}: optics") if "optics" in data else None,
    )


def _levels(entries: Any, where: str, span: int) -> tuple[tuple[float, ...], np.ndarray, np.ndarray]:
    if not isinstance(entries, list) or not entries:
        raise FsidError(f"{where}: levels must be a list with one entry per ISO")
    iso, k, sigma2 = [], [], []
    for number, entry in enumerate(entries):
        here = f"{where}: levels[{number}]"
        _check_keys(entry, here, {"iso", "k", "sigma2"}, {"k_dn", "sigma2_dn"} | _MEASURED)
        iso.append(_number(entry["iso"], f"{here}.iso"))
        k.append(_site_values(entry, "k", here, span))
        sigma2.append(_site_values(entry, "sigma2", here, span**2))
        if min(k[-1]) <= 0:
            raise FsidError(f"{here}.k: the gain of every site must be positive")
        if max(sigma2[-1]) >= ROUNDING_DN2:  # in DN^2 it could not be less
            raise FsidError(
                f"{here}.sigma2: {max(sigma2[-1]):g} is not below 1/12; is it in DN^2? It is to be divided "
                f"by (white_level - black_level)^2 = {span**2}"
            )
        if not all(0 < variance <= 1 for variance in np.add(k[-1], sigma2[-1])):
            raise FsidError(f"{here}: k + sigma2, the variance at white, must be above 0 and at most 1")
    if iso[0] <= 0 or any(b <= a for a, b in pairwise(iso)):
        raise FsidError(f"{where}: levels must be in order of rising, positive iso; got {iso}")
    if np.max(sigma2, axis=0).min() < 0:
        raise FsidError(f"{where}: levels: the sigma2 of a site is negative at every iso")
    return tuple(iso), np.array(k), np.array(sigma2)


def _measurement(entries: list[dict[str, Any]], where: str) -> Measurement | None:
    if not any(_MEASURED & entry.keys() for entry in entries):
        return None
    table: dict[str, list[Any]] = {key: [] for key in _MEASURED}
    for number, entry in enumerate(entries):
        here = f"{where}: levels[{number}]"
        if missing := _MEASURED - entry.keys():
            raise FsidError(f"{here}: missing key {', '.join(sorted(missing))}; a calibrated level has all")
        for key in ("k_error", "sigma2_error", "black"):
            table[key].append(_four_numbers(entry[key], f"{here}.{key}"))
        for key in ("frames", "dark_frames"):
            table[key].append(int(_number(entry[key], f"{here}.{key}")))
    arrays = {key: np.array(table[key]) for key in ("k_error", "sigma2_error", "black")}
    return Measurement(**arrays, frames=tuple(table["frames"]), dark_frames=tuple(table["dark_frames"]))


def _optics(data: Any, where: str) -> Optics:
    _check_keys(data, where, {"f_number", "pixel_pitch_um"}, {"quantum_efficiency", "transmittance"})
    values = {key: _number(value, f"{where}.{key}") for key, value in data.items()}
    for key, value in values.items():
        low, high, unit = _OPTICS[key]
        if not low <= value <= high:
            raise FsidError(f"{where}.{key} must be {low:g} to {high:g}{unit}; got {value:g}")
    return Optics(**values)


def _site_values(entry: dict[str, Any], key: str, where: str, unit: float) -> list[float]:
    """Four values of `key`, checked against `key`_dn = value * unit where that is given."""
    values = _four_numbers(entry[key], f"{where}.{key}")
    if f"{key}_dn" in entry:
        in_dn = _four_numbers(entry[f"{key}_dn"], f"{where}.{key}_dn")
        if not np.allclose(in_dn, np.multiply(values, unit), rtol=_DN_TOLERANCE, atol=0):
            raise FsidError(f"{where}.{key}_dn is not {key} x {unit:g}; correct one or remove {key}_dn")
    return values


def _matrices(data: dict[str, Any], where: str) -> np.ndarray:
    if "xyz_to_camera" not in data:
        return published_matrices()
    try:
        matrices = np.asarray(data["xyz_to_camera"], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        matrices = np.empty(0)
    if matrices.ndim != 3 or matrices.shape[1:] != (3, 3) or not len(matrices):
        raise FsidError(f"{where}: xyz_to_camera must be a list of 3x3 matrices of numbers")
    if not is_of_camera(matrices):
        raise FsidError(
            f"{where}: xyz_to_camera: a matrix has no inverse, or sees no light where there is white"
        )
    return matrices


def _check_keys(data: Any, where: str, required: set[str], optional: set[str]) -> None:
    if not isinstance(data, dict):
        raise FsidError(f"{where}: expected `key: value` lines, found {type(data).__name__}")
    if missing := required - data.keys():
        raise FsidError(f"{where}: missing key {', '.join(sorted(missing))}")
    if unknown := data.keys() - required - optional:
        raise FsidError(
            f"{where}: unknown key {', '.join(sorted(map(str, unknown)))}; "
            f"known: {', '.join(sorted(required | optional))}"
        )


def _integer(data: dict[str, Any], key: str, where: str, low: int, high: int) -> int:
    value = data[key]
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise FsidError(f"{where}: {key} must be an integer from {low} to {high}; got {value!r}")
    return value


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _LARGEST:
        raise FsidError(f"{where} must be a number; got {value!r} (write 1.0e-05, YAML takes 1e-05 for text)")
    return float(value)


def _four_numbers(values: Any, where: str) -> list[float]:
    if not isinstance(values, list) or len(values) != 4:
        raise FsidError(f"{where} must list four numbers, for the sites R, Gr, Gb, B; got {values!r}")
    return [_number(value, where) for value in values]
