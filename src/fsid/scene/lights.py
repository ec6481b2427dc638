"""Lights: lamps indoors, sun and sky out of doors, and the light that comes back from everywhere.

    E at the focus = sum of all lights = drawn `irradiance`,     ambient radiance = ambient_share * E / pi

A camera adapts to the colour of light and the sensor simulation takes it for white, so the colours of all
lights of a scene are divided by a part of their mean: `adaptation`. What stays is what stays in photographs:
warm beside cool light within one picture, and a remainder of the cast.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fsid.scene.choice import log_uniform_rand, share_rand
from fsid.scene.colour import LUMINANCE, blackbody_rgb
from fsid.scene.config import LightConfig
from fsid.scene.model import Light, Sky, Vec3
from fsid.scene.surroundings import Space
from fsid.scene.vectors import direction_of, vec3

KINDS = ("point", "spot", "area")
"""The order of `LightConfig.kind_shares`."""

SUN_TANGENT = 0.0047
_CLEAR, _OVERCAST = (0.0, 0.8), (0.6, 1.0)
"""Cloudiness with and without sun."""
_LEAST_PRIMARY = 0.05
"""Candle light has no blue within sRGB: this much is left, for the camera to amplify."""
_VIEW_DEG = 55.0
"""Within this angle of the line of sight no area light turns its dark back to the camera."""
_LEAST_REACH_M = 0.1
"""From the focus to an area light: nearer, it would lie behind it or in a wall."""


class Lighting(NamedTuple):
    """What shines in a scene: lights, the radiance of the unlit surroundings, and the sky out of doors."""

    lights: tuple[Light, ...]
    ambient: Vec3
    sky: Sky | None


def lighting_rand(
    stream: np.random.SeedSequence,
    config: LightConfig,
    space: Space,
    focus_m: np.ndarray,
    camera_m: np.ndarray,
    sky_source: str | None,
) -> Lighting:
    """All light of a scene. sky_source: `Sky.source` out of doors, None indoors."""
    scene_stream, *lamp_streams = stream.spawn(1 + config.count[1])
    rng = np.random.default_rng(scene_stream)
    irradiance = log_uniform_rand(rng, config.irradiance)
    ambient = irradiance / np.pi * log_uniform_rand(rng, config.ambient_share)
    adaptation = float(rng.uniform(*config.adaptation))
    count = int(rng.integers(config.count[0], config.count[1] + 1))
    shares = rng.dirichlet(np.full(config.count[1], 1.5))[:count]
    lamps = [
        _lamp_rand(np.random.default_rng(s), config, space, focus_m, camera_m, irradiance * share)
        for s, share in zip(lamp_streams, shares / shares.sum(), strict=False)
    ]
    if sky_source is None:
        mean = np.sum([_irradiance(lamp, focus_m) for lamp in lamps], axis=0)
        return _adapted(lamps, ambient * mean / (mean @ LUMINANCE), None, focus_m, adaptation)
    night = rng.random() < config.night_share
    sun, sky = _daylight_rand(rng, config, irradiance, sky_source)
    if night:
        sky = replace(sky, colour=vec3(np.array(sky.colour) * (0.3 * ambient / (sky.colour @ LUMINANCE))))
    lights = lamps if night else sun
    return _adapted(lights, np.array(sky.colour), sky, focus_m, adaptation)


def _lamp_rand(
    rng: np.random.Generator,
    config: LightConfig,
    space: Space,
    focus_m: np.ndarray,
    camera_m: np.ndarray,
    irradiance: float,
) -> Light:
    """One lamp above the focus that gives it the irradiance."""
    kind = KINDS[share_rand(rng, config.kind_shares)]
    direction = direction_of(rng.uniform(0, 360), rng.uniform(30, 85))
    distance = rng.uniform(*config.distance_m)
    rgb = _lamp_colour_rand(rng, config)
    cone_deg = float(rng.uniform(35, 100))
    aim = rng.normal(0, np.tan(np.radians(cone_deg / 2)) * 0.3, 3)
    radius_m = log_uniform_rand(rng, config.radius_m)
    size_m = np.array([log_uniform_rand(rng, config.area_m) for _ in range(2)])
    if kind == "area":
        panel = _panel(space, focus_m, camera_m, direction, distance, size_m)
        if panel:
            position_m, outward, edges_m = panel
            colour = rgb * irradiance * float(np.sum((position_m - focus_m) ** 2)) / (edges_m[0] * edges_m[1])
            return Light("area", vec3(position_m), vec3(-outward), vec3(colour), 0.0, 180.0, edges_m)
        kind = "point"
    reach = space.reach(focus_m, direction, distance)
    aim = aim - direction
    return Light(
        kind=kind,
        position_m=vec3(focus_m + direction * reach),
        direction=vec3(aim / np.linalg.norm(aim)),
        colour=vec3(rgb * irradiance * reach**2),
        radius_m=min(radius_m, 0.3 * reach),
        cone_deg=cone_deg if kind == "spot" else 360.0,
    )


def _panel(
    space: Space,
    focus_m: np.ndarray,
    camera_m: np.ndarray,
    direction: np.ndarray,
    distance: float,
    size_m: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, tuple[float, float]] | None:
    """Place, direction from the focus and edges of an area light that fits; None where none does, or where
    its back is in view.

    The four mirror images of the drawn direction are tried in turn.
    """
    for sx, sy in ((1, 1), (-1, -1), (1, -1), (-1, 1)):
        outward = direction * (sx, sy, 1)
        width, height = np.minimum(size_m, 0.6 * space.reach(focus_m, outward, distance))
        reach = space.reach(focus_m, outward, distance, float(np.hypot(width, height)) / 2 - 0.15)
        if reach < _LEAST_REACH_M:
            continue
        position_m = focus_m + outward * reach
        to_light, to_focus = position_m - camera_m, focus_m - camera_m
        cosine = to_light @ to_focus / np.linalg.norm(to_light) / np.linalg.norm(to_focus)
        if to_light @ outward > 0 or cosine < np.cos(np.radians(_VIEW_DEG)):
            return position_m, outward, (float(width), float(height))
    return None


def _lamp_colour_rand(rng: np.random.Generator, config: LightConfig) -> np.ndarray:
    """(3,) linear colour of luminance 1: a black body, or a coloured LED."""
    rgb = blackbody_rgb(_temperature_rand(rng, config.temperature_k))
    tinted, tint = rng.random() < config.tinted_share, rng.uniform(0.2, 1.0, 3)
    if tinted:
        rgb = rgb * tint
    rgb = np.maximum(rgb, _LEAST_PRIMARY * rgb.max())
    return rgb / (rgb @ LUMINANCE)


def _temperature_rand(rng: np.random.Generator, limits_k: tuple[float, float]) -> float:
    """Kelvin, uniform in 1 / temperature."""
    return float(1.0 / rng.uniform(1.0 / limits_k[1], 1.0 / limits_k[0]))


def _daylight_rand(
    rng: np.random.Generator, config: LightConfig, irradiance: float, source: str
) -> tuple[list[Light], Sky]:
    """The sun, if it shines, and the sky that shares the irradiance with it; a picture has one or none."""
    sunny = rng.random() < config.sun_share and source == "procedural"
    height_deg = float(np.degrees(np.arcsin(rng.uniform(0.1, 0.97))))
    azimuth_deg = float(rng.uniform(0, 360))
    sun_k = float(np.interp(height_deg, (5, 40), (3000, 5600)))
    ratio = log_uniform_rand(rng, config.sun_to_sky) if sunny else 0.0
    haze = log_uniform_rand(rng, (1.0, 8.0))
    cloudiness = float(np.interp(rng.random(), (0, 1), _CLEAR if sunny else _OVERCAST))
    sky_k = np.interp(cloudiness, (0.0, 1.0), (16000.0, 6500.0)) * np.exp(rng.normal(0, 0.1))
    seed, turn_deg = int(rng.integers(2**31)), float(rng.uniform(0, 360))
    sky = Sky(
        source=source,
        colour=vec3(blackbody_rgb(float(sky_k)) * irradiance / np.pi / (1 + ratio)),
        seed=seed,
        cloudiness=cloudiness,
        azimuth_deg=turn_deg,
    )
    if not sunny:
        return [], sky
    light = blackbody_rgb(sun_k) * irradiance * ratio / (1 + ratio)
    down = vec3(-direction_of(azimuth_deg, height_deg))
    return [Light("sun", (0.0, 0.0, 0.0), down, vec3(light), SUN_TANGENT * haze, 0.0)], sky


def _irradiance(light: Light, point_m: np.ndarray) -> np.ndarray:
    """(3,) what a surface at the point that faces the light receives, without shadow."""
    colour = np.array(light.colour)
    if light.kind == "sun":
        return colour
    distance2 = float(np.sum((np.array(light.position_m) - point_m) ** 2))
    return colour * (np.prod(light.size_m) if light.kind == "area" else 1.0) / distance2


def _adapted(
    lights: list[Light], ambient: np.ndarray, sky: Sky | None, focus_m: np.ndarray, adaptation: float
) -> Lighting:
    """The lighting with its mean colour moved towards white, at the same mean luminance."""
    mean = np.pi * ambient + sum((_irradiance(light, focus_m) for light in lights), np.zeros(3))
    gains = (mean / (mean @ LUMINANCE)) ** -adaptation
    gains *= (mean @ LUMINANCE) / (mean * gains @ LUMINANCE)
    return Lighting(
        lights=tuple(replace(light, colour=vec3(light.colour * gains)) for light in lights),
        ambient=vec3(ambient * gains),
        sky=None if sky is None else replace(sky, colour=vec3(sky.colour * gains)),
    )
