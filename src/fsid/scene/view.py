"""Cameras: one view of the focus, then the eyes of a rig and the frames of a burst around it.

    eye e      moved by (e - (E - 1) / 2) baselines to the right, less where a wall or hill is in the way
    frame f    at time f * interval: hand tremor is a sum of sines per axis, zero at time 0
    blur       straight: velocity and spin lead from the pose as the shutter opens to that as it closes

A path of sines bends back within a long exposure: going on with the velocity of one moment would blur by more
than the hand moves. Amplitudes fall as 1 / frequency over the 1 to 12 Hz of a hand (physiological tremor:
Elble and Randall 1976). Frame 0 of the middle view is the view as drawn, so a burst shows the scene that a
single picture of the same seed shows.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from fsid.assets import ground_height_m
from fsid.assets.solids import rotation_matrix
from fsid.scene.camera_config import CameraConfig, MotionConfig, RigConfig
from fsid.scene.choice import log_uniform_rand
from fsid.scene.knobs import Range
from fsid.scene.model import Background, Camera, Motion
from fsid.scene.surroundings import space_of
from fsid.scene.vectors import direction_of, vec3

LOW_VIEW_DEG, LOW_VIEW_M = 20.0, 1.25
"""Below this elevation a camera keeps this distance: the fixed arrangement of v1-v3 ends before it."""
SKYWARD_ELEVATION = 0.2
"""Views that look up are taken from so many times the elevation that was drawn."""
FOCUS_SEEN = 0.8
"""Of a low arrangement the focus is at most so many half heights below the middle: 1 is the lower edge."""
EYE_SLACK_M = 0.15
"""The eyes of a rig may be so much nearer to walls, and a third of it to the ground, than the drawn view."""

_LEAST_BASELINE_M = 1e-3
_TREMOR_HZ = (1.0, 12.0)
_SINES = 6
_MOMENT_S = 1e-4
"""In which the velocity of a moment is measured: a shutter that is open for no time has the derivative."""


def camera_rand(
    rng: np.random.Generator,
    config: CameraConfig,
    background: Background,
    width: int,
    height: int,
    *,
    low: bool = False,
) -> tuple[Camera, np.ndarray, float]:
    """A camera inside a background, the focus (3,) in metres, which it looks at, or above it at the sky, and
    how far from it is what it would look at otherwise.

    One that stands in the hills stands as much higher as they are there. low: nothing rises above the focus,
    so that it stays in the picture.
    """
    space, outdoors = space_of(background), background.kind == "open-air"
    sky_rng = rng.spawn(1)[0]
    skyward, horizon = outdoors and sky_rng.random() < config.skyward_share, sky_rng.uniform(*config.skyward)
    focus = np.array([0.0, 0.0, rng.uniform(0.2, 0.5)])
    distance = log_uniform_rand(rng, config.distance_m)
    azimuth_deg, elevation_deg = rng.uniform(0, 360), rng.uniform(*config.elevation_deg)
    elevation_deg *= SKYWARD_ELEVATION if skyward else 1.0
    if elevation_deg < LOW_VIEW_DEG:
        distance = max(distance, LOW_VIEW_M / np.cos(np.radians(elevation_deg)))
    direction = direction_of(azimuth_deg, elevation_deg)
    position = focus + direction * space.reach(focus, direction, distance)
    if outdoors:
        position[2] += ground_height_m(background.size_m, position[0], position[1])
    target = focus + rng.normal(0, 0.12, 3) * np.linalg.norm(position - focus)
    roll, fov_deg = np.radians(rng.normal(0, config.roll_deg)), float(rng.uniform(*config.fov_deg))
    depth = float(np.linalg.norm(np.subtract(vec3(target), vec3(position))))
    if skyward:
        ahead = target - position
        half = np.tan(np.radians(fov_deg / 2)) * height / width
        slope = horizon * half
        if low:
            to_focus = focus - position
            slope = min(slope, to_focus[2] / np.hypot(to_focus[0], to_focus[1]) + FOCUS_SEEN * half)
        ahead[2] = slope * np.hypot(ahead[0], ahead[1])
        target = position + ahead
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    if np.linalg.norm(right) < 1e-3:
        right = direction_of(azimuth_deg + 90, 0)
    right /= np.linalg.norm(right)
    up = np.cos(roll) * np.cross(right, forward) + np.sin(roll) * right
    return Camera(vec3(position), vec3(target), vec3(up), fov_deg, width, height), focus, depth


def rig_rand(
    rng: np.random.Generator, config: RigConfig, camera: Camera, background: Background
) -> list[Camera]:
    """The eyes of a rig; one eye is the camera itself. The baseline shrinks until all of them are inside."""
    baseline_m = float(rng.uniform(*config.baseline_m))
    position, target = np.array(camera.position_m), np.array(camera.target_m)
    right = np.cross(target - position, camera.up)
    right /= np.linalg.norm(right)
    across = right * (np.arange(config.eyes) - (config.eyes - 1) / 2)[:, None]
    while baseline_m > _LEAST_BASELINE_M and not _are_inside(position + across * baseline_m, background):
        baseline_m *= 0.9
    eyes = []
    for eye, shift in enumerate(across * baseline_m):
        aim = target + shift * (1 - config.convergence)
        eyes.append(replace(camera, position_m=vec3(position + shift), target_m=vec3(aim), eye=eye))
    return eyes


def _are_inside(eyes_m: np.ndarray, background: Background) -> bool:
    """Whether places (E, 3), around one that `camera_rand` has drawn, are off walls and above the ground."""
    space = space_of(background)
    slack_m = np.array((EYE_SLACK_M, EYE_SLACK_M, EYE_SLACK_M / 3))
    outdoors = background.kind == "open-air"
    high = np.array((*space.high[:2], np.inf)) if outdoors else space.high  # hills end where they end
    if not ((eyes_m > space.low - slack_m) & (eyes_m < high + slack_m)).all():
        return False
    if not outdoors:
        return True
    ground_m = ground_height_m(background.size_m, eyes_m[:, 0], eyes_m[:, 1])
    return bool((eyes_m[:, 2] > ground_m + space.low[2] - slack_m[2]).all())


def burst_rand(rng: np.random.Generator, config: MotionConfig, eyes: list[Camera]) -> tuple[Camera, ...]:
    """Frames x eyes cameras, all frames of an eye in a row; the eyes shake together."""
    exposure_s = float(rng.uniform(*config.exposure_s))
    wave_hz = _TREMOR_HZ[0] * (_TREMOR_HZ[1] / _TREMOR_HZ[0]) ** rng.random((_SINES, 6))
    phase = rng.uniform(0, 2 * np.pi, (_SINES, 6))
    angle_deg, shift_m = _shake_rand(rng, config.shake_deg), _shake_rand(rng, config.shake_m)
    scale = np.repeat((shift_m, angle_deg), 3) * np.sqrt(2.0)
    amplitude = scale / wave_hz / np.sqrt((1 / wave_hz**2).sum(0))
    if config.frames == 1 and exposure_s == 0:
        return tuple(eyes)
    centre = np.mean([eye.position_m for eye in eyes], axis=0)
    open_s = max(exposure_s, _MOMENT_S)

    def tremor(time_s: float) -> np.ndarray:
        """How far the rig is shifted, metres, and turned, degrees: (6,)."""
        return np.asarray((amplitude * (np.sin(2 * np.pi * wave_hz * time_s + phase) - np.sin(phase))).sum(0))

    out = []
    for eye in eyes:
        for frame in range(config.frames):
            time_s = frame * config.interval_s
            opens, closes = tremor(time_s - open_s / 2), tremor(time_s + open_s / 2)
            before, after = (_moved(eye, centre, at).position_m for at in (opens, closes))
            out.append(
                replace(
                    _moved(eye, centre, tremor(time_s)),
                    frame=frame,
                    time_s=time_s,
                    exposure_s=exposure_s,
                    velocity_m_s=vec3(np.subtract(after, before) / open_s),
                    spin_deg_s=vec3(_turn_deg(opens, closes) / open_s),
                )
            )
    return tuple(out)


def motions_rand(stream: np.random.SeedSequence, config: MotionConfig, count: int) -> tuple[Motion, ...]:
    """One motion per object; empty where no time passes or nothing moves."""
    if not config.moving_share or (config.frames == 1 and config.exposure_s[1] == 0):
        return ()
    return tuple(_motion_rand(np.random.default_rng(s), config) for s in stream.spawn(count))


def _motion_rand(rng: np.random.Generator, config: MotionConfig) -> Motion:
    moving = rng.random() < config.moving_share
    headings = rng.normal(size=(2, 3))
    headings /= np.linalg.norm(headings, axis=1, keepdims=True)
    speed, spin = log_uniform_rand(rng, config.speed_m_s), log_uniform_rand(rng, config.spin_deg_s)
    return Motion(vec3(headings[0] * speed), vec3(headings[1] * spin)) if moving else Motion()


def _shake_rand(rng: np.random.Generator, limits: Range) -> float:
    """Log-uniform where the limits allow it, uniform where they include 0."""
    at = rng.random()
    low, high = limits
    return float(low * (high / low) ** at) if low > 0 else float(low + at * (high - low))


def _moved(camera: Camera, centre_m: np.ndarray, tremor: np.ndarray) -> Camera:
    """The camera shifted, and turned about the world axes through the middle of its rig."""
    turn = rotation_matrix(*tremor[3:])
    position = centre_m + tremor[:3] + turn @ np.subtract(camera.position_m, centre_m)
    target = position + turn @ np.subtract(camera.target_m, camera.position_m)
    return replace(
        camera, position_m=vec3(position), target_m=vec3(target), up=vec3(turn @ np.array(camera.up))
    )


def _turn_deg(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """(3,) degrees about a world axis: the one rotation from the tremor (6,) before to that after."""
    turn = rotation_matrix(*after[3:]) @ rotation_matrix(*before[3:]).T
    return np.degrees(Rotation.from_matrix(turn).as_rotvec())
