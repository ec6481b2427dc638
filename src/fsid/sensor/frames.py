"""Frames on disk, sorted into bursts: same ISO, same exposure, same light.

RAW files say their ISO and exposure time. Bare mosaics (.npy, .png, .tif, .raw) say nothing: their ISO is
what their path says ("iso3200/a.png", "dark_ISO800_3.npy") or the caller gives, and consecutive files whose
mean level agrees within 3 % or half a DN are one burst; dark frames also within 3 sigma of their noise, since
black levels drift. Frames are opened one by one and never kept.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np

from fsid.errors import FsidError
from fsid.plurals import counted
from fsid.sensor.bare import BARE_SUFFIXES, Layout, check_bayer, check_white, read_dn
from fsid.sensor.black_levels import BlackLevels
from fsid.sensor.camera_profile import MONO
from fsid.sensor.defects import GAUSS_MAD
from fsid.sensor.dng import RawHeader, read_header, read_stored
from fsid.sensor.mosaic import TILE, check_cfa
from fsid.sensor.quantise import check_levels

SAME_LIGHT, SAME_DN = 0.03, 0.5  # difference of the levels of two frames of one burst, relative or in DN
SAME_DARK = 3.0  # difference of the levels of two dark frames of one burst, in standard deviations of a pixel
SAME_BLACK_DN = 1.0  # difference of the stated black levels of two frames of one mode: phones measure it anew
RAW_SUFFIXES = frozenset(
    """.3fr .arw .cr2 .cr3 .crw .dcr .dng .erf .fff .iiq .k25 .kdc .mef .mos .mrw .nef .nrw .orf .pef .raf
    .rw2 .rwl .sr2 .srf .srw""".split()  # noqa: SIM905  a list of them would take a page
)
BESIDE_RAW = frozenset(
    ".jpg .jpeg .heic .heif .xmp .txt .md .csv .json .yaml .yml .ini .db".split()  # noqa: SIM905  likewise
)
"""What phones, converters, people and systems (Thumbs.db) store beside frames."""
_ISO_IN_PATH = re.compile(r"iso[-_ ]?(\d+)", re.IGNORECASE)
_SITES_DIFFER = 0.02  # of the level: a flat grey through colour filters differs by far more


@dataclass(frozen=True, eq=False)
class Camera:
    """What all frames of a calibration share. cfa: None without filters. black_level: None where unknown.

    black: of every pixel of the first frame, of bare mosaics what the caller states; None where unknown.
    shape: (H, W). xyz_to_camera: (3, 3) of D65, None where unknown.
    """

    name: str
    cfa: str | None
    black_level: int | None
    white_level: int
    bare: bool
    shape: tuple[int, ...]
    black: BlackLevels | None = None
    xyz_to_camera: np.ndarray | None = None

    def site_black(self) -> np.ndarray | None:
        """(4,) black level of sites in what `FrameSet.read` returns, (1,) without a CFA; None if unknown."""
        if self.black_level is None:
            return None
        if self.black is None or self.cfa is None:
            return np.full(1, float(self.black_level) if self.black is None else self.black.mean())
        return self.black.of_sites(self.black_level, self.cfa)

    def moved(self) -> np.ndarray:
        """(4,) or (1,) DN that `FrameSet.read` takes off the sites, so that their black levels are alike."""
        if self.black_level is None or self.black is None or self.cfa is None:
            return np.zeros(1)
        return self.black.moved(self.black_level, self.cfa)


@dataclass(frozen=True)
class Frame:
    """A frame on disk. iso and exposure_s: 0 where unknown.

    level: mean DN of a bare mosaic, else 0. same_dn: how far the level of another frame of its burst may lie.
    """

    path: Path
    iso: float
    exposure_s: float
    level: float = 0.0
    same_dn: float = 0.0


@dataclass(frozen=True)
class FrameSet:
    """The frames and dark frames of one camera. date: of the first frame, "" where unknown.

    step_dn: all integers are multiples of it: 16 where 12 bits are the upper ones of 16; 0 if all are 0.
    """

    camera: Camera
    frames: tuple[Frame, ...]
    dark: tuple[Frame, ...]
    date: str
    notes: tuple[str, ...]
    step_dn: int

    def read(self, frame: Frame, layout: Layout) -> np.ndarray:
        """DN (H, W) of `frame`; FsidError where it is of another camera or another mode.

        They are the stored integers. Only where the black levels of pixels are whole DN apart, those of the
        first frame are made alike. A black level that drifts from frame to frame is in the integers already.
        """
        camera = self.camera
        if camera.bare:
            dn = read_dn(frame.path, cfa=camera.cfa, width=layout.width, height=layout.height)
            if camera.black is None or camera.black_level is None:
                return dn
            return camera.black.levelled(dn, camera.black_level, camera.white_level)
        assert camera.black is not None
        assert camera.black_level is not None
        stored = read_stored(frame.path)
        drift_dn = abs(stored.black.mean() - camera.black.mean())
        if (stored.cfa, stored.white_level) != (camera.cfa, camera.white_level) or drift_dn > SAME_BLACK_DN:
            found = (stored.cfa, stored.black_level, stored.white_level)
            expected = (camera.cfa, camera.black_level, camera.white_level)
            raise FsidError(
                f"{frame.path}: CFA, black and white level are {found}, those of the first frame {expected}; "
                f"give frames of one camera in one mode"
            )
        if stored.dn.shape != camera.shape:
            (height, width), (rows, columns) = stored.dn.shape, camera.shape
            raise FsidError(
                f"{frame.path}: is {width}x{height}, the first frame {columns}x{rows}; "
                f"give frames of one camera in one mode"
            )
        return camera.black.levelled(stored.dn, camera.black_level, camera.white_level)


def find_frames(paths: Sequence[Path], dark: Sequence[Path], layout: Layout) -> FrameSet:
    """Look at every file once: RAW headers, and the level and maximum of bare mosaics."""
    paths, dark = frame_files(paths), frame_files(dark)
    if not paths:
        raise FsidError("calibration needs the frames of at least one burst")
    if both := {path.resolve() for path in paths} & {path.resolve() for path in dark}:
        raise FsidError(f"{min(both)}: is given as a frame and as a dark frame; leave one out")
    if layout.iso is not None and not 0 < layout.iso < math.inf:
        raise FsidError(f"--iso {layout.iso:g}: must be a number above 0")
    bare = paths[0].suffix.lower() in BARE_SUFFIXES
    others = [path for path in (*paths, *dark) if (path.suffix.lower() in BARE_SUFFIXES) != bare]
    if others:
        known = RAW_SUFFIXES.union(BARE_SUFFIXES)
        for path in (*paths, *dark):
            if path.suffix.lower() not in known:
                raise FsidError(f"{path}: is neither a RAW file nor a bare mosaic; leave it out")
        advice = "RAW files and bare mosaics in one calibration; give frames of one kind"
        raise FsidError(f"{others[0]}: {advice}")
    if bare:
        return _bare_frames(paths, dark, layout)
    return _raw_frames(paths, dark, layout)


def bursts(frames: Sequence[Frame]) -> list[tuple[Frame, ...]]:
    """`frames` of one ISO, by exposure time and, for bare mosaics, by level in the given order."""
    found: list[list[Frame]] = []
    for _, same in groupby(sorted(frames, key=lambda f: f.exposure_s), key=lambda f: f.exposure_s):
        found.append([])
        for frame in same:
            if found[-1] and abs(frame.level - found[-1][0].level) > found[-1][0].same_dn:
                found.append([])
            found[-1].append(frame)
    return [tuple(burst) for burst in found]


def frame_files(paths: Sequence[Path]) -> list[Path]:
    """`paths` with folders replaced by the files in them and in their folders, each file once."""
    files: dict[Path, Path] = {}
    for path in paths:
        if not path.exists():
            raise FsidError(f"{path}: no such frame")
        found = _inside(path) if path.is_dir() else [path]
        if not found:
            raise FsidError(f"{path}: holds no frames")
        for file in found:
            files.setdefault(file.resolve(), file)
    return list(files.values())


def _inside(folder: Path) -> list[Path]:
    """The files of a folder and of its folders, without hidden ones and `BESIDE_RAW`; OSError where one may
    not be read."""

    def refuse(error: OSError) -> None:
        raise error

    files: list[Path] = []
    for top, folders, names in os.walk(folder, onerror=refuse):
        folders[:] = [name for name in folders if not name.startswith(".")]
        files += [Path(top, name) for name in names if not name.startswith(".")]
    return sorted(path for path in files if path.suffix.lower() not in BESIDE_RAW and path.is_file())


def _raw_frames(paths: Sequence[Path], dark: Sequence[Path], layout: Layout) -> FrameSet:
    first = read_stored(paths[0])
    headers = {path: read_header(path) for path in (*paths, *dark)}
    name = headers[paths[0]].camera
    for path, header in headers.items():
        if header.camera != name:
            raise FsidError(
                f"{path}: is from camera {header.camera!r}, the first frame from {name!r}; "
                f"calibrate one camera at a time"
            )
    camera = Camera(
        name,
        first.cfa,
        first.black_level,
        first.white_level,
        bare=False,
        shape=first.dn.shape,
        black=first.black,
        xyz_to_camera=first.xyz_to_camera,
    )
    if replace(layout, iso=None) != Layout():
        raise FsidError(
            f"{paths[0]}: a RAW file states its CFA, levels and size itself; leave the options out"
        )

    def frame(path: Path) -> Frame:
        header: RawHeader = headers[path]
        return Frame(path, header.iso or _iso_in(path), header.exposure_s)

    frames, notes = _with_iso([frame(path) for path in (*paths, *dark)], layout.iso)
    return FrameSet(
        camera,
        tuple(frames[: len(paths)]),
        tuple(frames[len(paths) :]),
        headers[paths[0]].date,
        notes,
        _step_dn(first.dn),
    )


def _bare_frames(paths: Sequence[Path], dark: Sequence[Path], layout: Layout) -> FrameSet:
    cfa = None if layout.cfa in (None, MONO) else check_cfa(str(layout.cfa), "--cfa")
    levels = layout.black_level
    black = None if levels is None else BlackLevels.stated(levels, cfa, "--black-level")
    level = None if black is None else round(black.mean())
    frames: list[Frame] = []
    highest, shape, step_dn = 0, (), 0
    for number, path in enumerate((*paths, *dark)):
        dn = read_dn(path, cfa=cfa, width=layout.width, height=layout.height)
        if shape not in ((), dn.shape):
            raise FsidError(f"{path}: is {dn.shape[1]}x{dn.shape[0]}, the first frame is another size")
        if number == 0:
            check_bayer(dn, path)
            if layout.cfa is None:
                _check_mono(path, dn)
        if layout.white_level is not None:
            check_white(dn, level or 0, layout.white_level, path)
        shape, highest, step_dn = dn.shape, max(highest, int(dn.max())), math.gcd(step_dn, _step_dn(dn))
        mean_dn, noise_dn = float(dn.mean()), _noise_dn(dn) if number >= len(paths) else 0.0
        same_dn = max(SAME_LIGHT * mean_dn, SAME_DN, SAME_DARK * noise_dn)
        frames.append(Frame(path, _iso_in(path), 0.0, mean_dn, same_dn))
    notes = []
    if layout.cfa is None:
        notes.append("taken for a sensor without colour filters (MONO); --cfa states its pattern")
    white = layout.white_level
    if white is None:
        white = 2 ** max(highest.bit_length(), 8) - 1
        notes.append(
            f"white level {white} DN taken from the largest value, {highest}; --white-level states it"
        )
    frames, assumed = _with_iso(frames, layout.iso)
    for stated in (0.0,) if black is None else (black.tile.min(), black.tile.max()):
        check_levels(stated, white, str(paths[0]))
    camera = Camera("", cfa, level, white, bare=True, shape=shape, black=black)
    found, notes = tuple(frames), [*notes, *assumed]
    return FrameSet(camera, found[: len(paths)], found[len(paths) :], "", tuple(notes), step_dn)


def _with_iso(frames: list[Frame], given: float | None) -> tuple[list[Frame], tuple[str, ...]]:
    """The frames with the ISO that is `given`, else that of the others where they have one, else 100 where
    they state none; a note where it is not theirs.

    FsidError where one ISO is given for frames that state several.
    """
    stated: dict[float, Path] = {}
    for frame in frames:
        if frame.iso > 0:
            stated.setdefault(frame.iso, frame.path)
    if given is None:
        unknown = [frame.path for frame in frames if not frame.iso > 0]
        if not unknown:
            return frames, ()
        iso = next(iter(stated)) if len(stated) == 1 else 100.0
        known = [frame if frame.iso > 0 else replace(frame, iso=iso) for frame in frames]
        if not stated:
            return known, ("no ISO known, noted as ISO 100; --iso states it",)
        whose = "that of the others" if len(stated) == 1 else "theirs is unknown"
        first = f"{counted(len(unknown), 'frame')}, the first one {unknown[0]}"
        return known, (f"{first}: taken for ISO {iso:g}, {whose}; name it in the path or give --iso",)
    if len(stated) > 1:
        (one, path), (two, other), *_ = stated.items()
        raise FsidError(
            f"--iso {given:g}: {path} states ISO {one:g}, {other} ISO {two:g}; leave the option out, or give "
            f"the frames of one ISO"
        )
    notes = [f"--iso {given:g} is taken in place of ISO {iso:g}, which the frames state" for iso in stated]
    return [replace(frame, iso=given) for frame in frames], tuple(notes if given not in stated else ())


def _iso_in(path: Path) -> float:
    """The last ISO in a path, 0 where there is none; ISO 12233 is a chart."""
    named = [number for number in _ISO_IN_PATH.findall(path.as_posix()) if number != "12233"]
    return float(named[-1]) if named else 0.0


def _noise_dn(dn: np.ndarray) -> float:
    """Standard deviation of a pixel of an even picture, from neighbours of the same site in its row."""
    steps = np.abs(dn[:, 2:].astype(np.int32) - dn[:, :-2])
    return float(np.median(steps)) / (GAUSS_MAD * np.sqrt(2)) if steps.size else 0.0


def _step_dn(dn: np.ndarray) -> int:
    """The largest number that all integers of `dn` are multiples of; 0 of zeros."""
    return int(np.gcd.reduce(dn, axis=None))


def _check_mono(path: Path, dn: np.ndarray) -> None:
    sites = [float(dn[site].mean()) for site in TILE]
    if max(sites) - min(sites) > _SITES_DIFFER * max(sites):
        raise FsidError(
            f"{path}: looks like a Bayer mosaic (its four sites differ); "
            f"give --cfa RGGB, BGGR, GRBG or GBRG, or MONO where it is none"
        )
