"""How a scene is seen: view, rig, movement and lens.

The defaults are one still camera with a good lens."""

# ruff: noqa: RUF009  (a knob is a dataclass field)
from __future__ import annotations

from dataclasses import dataclass

from fsid.errors import FsidError
from fsid.scene.knobs import Range, check_knobs, knob


@dataclass(frozen=True)
class CameraConfig:
    """Where the camera stands and how wide it sees."""

    distance_m: Range = knob((0.45, 3.0), 0.2, 100.0)
    """Distance from the focus; log-uniform. At least 1.25 m below 20 degrees of elevation;
    less where a wall is nearer."""
    elevation_deg: Range = knob((2.0, 55.0), 0.0, 88.0)
    """Angle above the horizon seen from the focus: low views see walls and horizon, high ones the ground."""
    fov_deg: Range = knob((28.0, 72.0), 5.0, 150.0)
    """Horizontal field of view, before distortion."""
    roll_deg: float = knob(2.5, 0.0, 180.0)
    """Standard deviation of the camera's roll."""
    skyward_share: float = knob(0.5, 0.0, 1.0)
    """Share of views in open air that are taken from low down and look up: things before the sky."""
    skyward: Range = knob((0.5, 2.5), -10.0, 10.0)
    """How far below the middle of those pictures the horizon lies; 1 is their lower edge. Less in v1 to v3,
    whose objects are low."""

    def __post_init__(self) -> None:
        check_knobs(self)


@dataclass(frozen=True)
class RigConfig:
    """Cameras that see the scene at the same time: 1 mono, 2 stereo, N an array; numbered by `Camera.eye`."""

    eyes: int = knob(1, 1, 64)
    """Number of cameras, side by side, centred on the drawn view."""
    baseline_m: Range = knob((0.05, 0.08), 0.0, 10.0)
    """Distance between neighbours; less where an eye would stand in a wall, behind one or in a hill."""
    convergence: float = knob(0.0, 0.0, 1.0)
    """0: parallel axes. 1: all look at the same point. Between: turned by that part."""

    def __post_init__(self) -> None:
        check_knobs(self)


@dataclass(frozen=True)
class MotionConfig:
    """Time: a burst of frames from a hand-held camera, moving objects, and the blur of both."""

    frames: int = knob(1, 1, 1000)
    """Number of frames of each eye; numbered by `Camera.frame`."""
    interval_s: float = knob(1 / 30, 1e-4, 10.0)
    """Time between frames."""
    exposure_s: Range = knob((0.0, 0.0), 0.0, 10.0)
    """Shutter time; above 0 everything that moves is blurred. In a burst at most `interval_s`."""
    shake_deg: Range = knob((0.05, 0.4), 0.0, 20.0)
    """Hand tremor: standard deviation of the camera's angle about each axis; log-uniform if above 0."""
    shake_m: Range = knob((0.0005, 0.003), 0.0, 1.0)
    """Hand tremor: standard deviation of the camera's position along each axis; log-uniform if above 0."""
    moving_share: float = knob(0.0, 0.0, 1.0)
    """Share of objects that move."""
    speed_m_s: Range = knob((0.02, 0.5), 1e-4, 50.0)
    """Speed of a moving object; log-uniform."""
    spin_deg_s: Range = knob((1.0, 90.0), 0.01, 10000.0)
    """Angular speed of a moving object; log-uniform."""

    def __post_init__(self) -> None:
        check_knobs(self)
        if self.frames > 1 and self.exposure_s[1] > self.interval_s:
            raise FsidError(
                f"exposure_s = {self.exposure_s}: frames of a burst come every interval_s = "
                f"{self.interval_s:.4g} s, and none is open for longer"
            )


@dataclass(frozen=True)
class LensConfig:
    """What a real lens does to the image; every share is one of scenes."""

    distortion_share: float = knob(0.0, 0.0, 1.0)
    """Share with Brown-Conrady distortion."""
    distortion: Range = knob((-0.15, 0.08), -0.5, 0.5)
    """Displacement at the corner of the image relative to its radius: below 0 barrel, above pincushion."""
    fisheye_share: float = knob(0.0, 0.0, 1.0)
    """Share with a fisheye lens instead."""
    blur_share: float = knob(0.12, 0.0, 1.0)
    """Share with depth of field; the rest is sharp everywhere."""
    aperture_m: Range = knob((0.004, 0.05), 1e-5, 0.5)
    """Diameter of the lens opening, for depth of field: a phone's to a fast lens's; log-uniform."""
    focus: Range = knob((0.7, 1.4), 0.1, 10.0)
    """Depth of the sharp plane relative to the distance of the focus."""
    vignetting_share: float = knob(0.3, 0.0, 1.0)
    """Share whose corners are darker."""
    vignetting: Range = knob((0.02, 0.4), 0.0, 0.95)
    """Light lost in the corner of the image."""
    fringe_share: float = knob(0.2, 0.0, 1.0)
    """Share with lateral chromatic aberration."""
    fringe: Range = knob((-0.0008, 0.0008), -0.02, 0.02)
    """Magnification of red and of blue relative to green, minus 1."""
    soft_share: float = knob(1.0, 0.0, 1.0)
    """Share whose lens has a point spread; the rest is as sharp as its pixels."""
    softness_px: Range = knob((0.28, 0.65), 0.0, 20.0)
    """Standard deviation of the lens's point spread, pixels of the image."""
    sharp_share: float = knob(0.9, 0.0, 1.0)
    """Share of pictures that are sharpened, as published photographs are."""
    sharpening: Range = knob((0.4, 1.3), 0.0, 5.0)
    """How much of the detail finer than a pixel or so is added once more."""
    contrast_red: Range = knob((0.05, 0.17), -0.5, 0.5)
    """Contrast of red (slope in logarithms, on luminance) relative to green, minus 1."""
    contrast_blue: Range = knob((0.04, 0.16), -0.5, 0.5)
    """The same of blue."""

    def __post_init__(self) -> None:
        check_knobs(self)
