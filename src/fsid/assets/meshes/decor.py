"""Things to look at: framed pictures, clocks, globes."""

from __future__ import annotations

import numpy as np

from fsid.assets.forms import plate, slab
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import (
    Solid,
    ball,
    ball_directions,
    box,
    cylinder,
    lathe,
    sweep,
)


@mesh_family("picture_frame")
def picture_frame(rng: np.random.Generator) -> Parts:
    """Framed picture with a mount, upright with a slight lean: flat, round, stepped or oval frame."""
    x, z = rng.uniform(0.15, 0.6), rng.uniform(0.15, 0.6)
    wide, deep, lean = rng.uniform(0.01, 0.05), rng.uniform(0.012, 0.03), rng.uniform(0, 12)
    border = rng.uniform(0.1, 0.3) * min(x, z)
    if rng.random() < 0.25:
        a = np.linspace(0, 2 * np.pi, 72, endpoint=False)
        oval = np.c_[np.cos(a) * (x - wide) / 2, np.sin(a) * (z - wide) / 2]
        ring = np.c_[oval[:, 0], 0 * a, oval[:, 1]]
        frame = [sweep(ring, wide / 2, 12, closed=True)]
        frame += [sweep(ring * k, 0.12 * wide, 8, closed=True).at(y=-0.42 * wide) for k in (0.93, 1.04)]
        mount = plate(oval, 0.004, 0.0005).turned(x_deg=90)
        picture = plate(oval * (1 - border / x), 0.003, 0.0004).turned(x_deg=90).at(y=-0.0022)
        parts = {"frame": frame, "paper_mount": [mount], "paper_picture": [picture]}
        return {name: [s.at(z=z / 2).turned(x_deg=-lean) for s in solids] for name, solids in parts.items()}
    round_ = rng.uniform(0.002, 0.3 * wide)
    frame = _frame(x, z, wide, deep, round_)
    if rng.random() < 0.5:
        step = rng.uniform(0.2, 0.5) * wide
        inner = _frame(
            x - 2 * wide + 2 * step - 0.003, z - 2 * wide + 2 * step - 0.003, step, deep * 1.25, 0.3 * step
        )
        frame += [s.at(z=wide - step + 0.0015) for s in inner]
    mount = box(x - wide, 0.004, z - wide, 0.001, 1).at(z=wide / 2)
    picture = box(x - wide - border, 0.003, z - wide - border, 0.0005, 1).at(0, -0.002, (wide + border) / 2)
    parts = {"frame": frame, "paper_mount": [mount], "paper_picture": [picture]}
    return {name: [s.turned(x_deg=-lean) for s in solids] for name, solids in parts.items()}


@mesh_family("clock")
def clock(rng: np.random.Generator) -> Parts:
    """Wall, desk or alarm clock: case, dial, hour marks, hands at any time, glass, perhaps bells and feet."""
    radius, deep = rng.uniform(0.05, 0.17), rng.uniform(0.02, 0.06)
    rim = radius * rng.uniform(0.06, 0.16)
    bezel = [(radius, deep), (radius - 0.3 * rim, deep + 0.4 * rim), (radius - rim, deep)]
    case = lathe([(0, 0), (radius, 0), *bezel, (radius - rim, 0.6 * deep), (0, 0.6 * deep)], 56, 30)
    dial = cylinder(radius - rim + 0.0006, 0.0016, 0.0003, 48).at(z=0.6 * deep)
    front, marks = 0.6 * deep + 0.0016, []
    number = int(rng.choice((4, 12, 12, 60)))
    for k in range(number):
        long = radius * (0.12 if number < 60 or k % 5 == 0 else 0.05)
        mark = box(0.025 * radius, long, 0.001, 0.0002, 1).at(y=0.72 * radius, z=front - 0.0002)
        marks.append(mark.turned(z_deg=360 * k / number))
    parts = {"case": [case], "paper_dial": [dial], "marks": marks}
    parts["metal_hands"] = [hand.at(z=front) for hand in _clock_hands_rand(rng, radius)]
    if rng.random() < 0.4:
        t = np.linspace(0, np.pi / 2, 7)
        dome = np.c_[(radius - rim + 0.001) * np.cos(t), 0.16 * radius * np.sin(t)]
        pane = lathe([(0, 0), *dome[:-1], (0, 0.16 * radius)], 48)
        parts["glass"] = [pane.at(z=max(front + 0.0085, 0.85 * deep))]
    parts = {name: [s.turned(x_deg=90).at(z=radius) for s in solids] for name, solids in parts.items()}
    if rng.random() < 0.5:
        parts["metal_bells"] = [p.at(y=-deep / 2) for p in _alarm(radius)]
    return parts


@mesh_family("globe")
def globe(rng: np.random.Generator) -> Parts:
    """Globe with raised continents, tilted in a meridian ring on a turned foot."""
    radius, tilt = rng.uniform(0.08, 0.16), rng.uniform(15, 30)
    d = ball_directions(4)
    field = sum(np.sin(d @ rng.normal(0, 2.2, 3) + rng.uniform(0, 6.3)) for _ in range(9))
    land = 1 / (1 + np.exp(-12 * (field - np.quantile(field, 0.65))))
    body = ball(radius * (1 + 0.012 * land + 0.0015 * field * land), 4)
    a = np.linspace(-np.pi / 2, np.pi / 2, 30)
    ring = sweep(1.1 * radius * np.c_[np.cos(a), 0 * a, np.sin(a)], 0.035 * radius, 8)
    axis = cylinder(0.03 * radius, 2.24 * radius, 0.002, 12).at(z=-1.12 * radius)
    stand = 0.55 * radius
    s = np.linspace(0, 1, 20)
    profile = radius * (0.1 + 0.5 * np.exp(-9 * s) + 0.05 * np.cos(12 * s))
    foot = lathe([(0, 0), *np.c_[profile, s * stand], (0, stand)], 32)
    lift = stand + 1.1 * radius
    turned = [p.turned(y_deg=tilt).at(z=lift) for p in (body, ring, axis)]
    return {"paper_globe": turned[:1], "metal_ring": turned[1:], "wood_foot": [foot]}


def _frame(x: float, z: float, wide: float, deep: float, bevel: float) -> list[Solid]:
    bars = [box(x, deep, wide, bevel, 3).at(z=s) for s in (0, z - wide)]
    upright = box(wide, deep - 0.0006, z - 1.4 * wide, bevel, 3).at(z=0.7 * wide)
    return bars + [upright.at(s * (x - wide - 0.0008) / 2) for s in (-1, 1)]


def _clock_hands_rand(rng: np.random.Generator, radius: float) -> list[Solid]:
    """Hour, minute and second hand on their pin, above z = 0, at a time that agrees."""
    minute = rng.uniform(0, 60)
    hour = rng.integers(12) + minute / 60
    shapes = ((hour / 12, 0.45, 0.035), (minute / 60, 0.68, 0.022), (rng.random(), 0.7, 0.008))
    hands = []
    for k, (angle, long, wide) in enumerate(shapes):
        y = np.linspace(-0.14, long, 6) * radius
        half = np.interp(np.arange(6), (0, 4, 5), (1.0, rng.uniform(0.6, 1.8), 0.25)) * wide * radius
        hand = slab(np.c_[-half, y], np.c_[half, y], 0.0009, 0.0002)
        hands.append(hand.turned(z_deg=-360 * angle).at(z=0.0022 + 0.0014 * k))
    return [*hands, cylinder(0.045 * radius, 0.0075, 0.001, 20).at(z=-0.0003)]


def _alarm(radius: float) -> list[Solid]:
    """Two legs, two bells and the bow of an alarm clock whose dial is centred at height `radius`."""
    profile = np.array([(0, 0), (0.33, 0), (0.3, 0.16), (0.14, 0.28), (0, 0.31)]) * radius
    bell = lathe(profile.tolist(), 28, 60)
    leg = sweep(np.array([(0, 0, 0), (0, 0, 0.3), (0, 0, 0.6)]) * radius, 0.06 * radius, 8)
    t = np.linspace(0, np.pi, 16)
    bow = np.c_[0.6 * np.cos(t), 0 * t, 2.1 + 0.4 * np.sin(t)] * radius
    legs = [leg.turned(y_deg=180 + 30 * s).at(s * 0.45 * radius, 0, 0.2 * radius) for s in (-1, 1)]
    bells = [bell.turned(y_deg=35 * s).at(s * 0.6 * radius, 0, 1.86 * radius) for s in (-1, 1)]
    return [*legs, *bells, sweep(bow, 0.035 * radius, 8)]
