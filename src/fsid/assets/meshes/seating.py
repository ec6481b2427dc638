"""Chairs and stools."""

from __future__ import annotations

import numpy as np

from fsid.assets.meshes.soft import pillow
from fsid.assets.meshes.tables import turned_post
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import box, cone, cylinder, rotation_matrix, sheet, sweep


@mesh_family("dining_chair")
def dining_chair(rng: np.random.Generator) -> Parts:
    """Four legs, a seat and a back of rails or spindles."""
    x, y, z = rng.uniform(0.38, 0.5), rng.uniform(0.38, 0.48), rng.uniform(0.42, 0.5)
    thick, post, back = rng.uniform(0.02, 0.05), rng.uniform(0.025, 0.045), rng.uniform(0.35, 0.6)
    dx, dy, lean = x / 2 - post, y / 2 - post, rng.uniform(2, 14)
    legs = [box(post, post, z - thick, 0.005).at(sx * dx, sy * dy) for sx in (-1, 1) for sy in (-1, 1)]
    frame = [box(post, post, back, 0.008).at(s * dx) for s in (-1, 1)]
    if rng.random() < 0.5:
        rail = rng.uniform(0.04, 0.08)
        frame += [
            box(2 * dx, 0.016, rail).at(z=h * back - rail) for h in np.linspace(1, 0.35, rng.integers(2, 5))
        ]
    else:
        spindles = np.linspace(-dx, dx, int(rng.integers(4, 8)) + 2)[1:-1]
        frame += [cylinder(0.008, back * 0.95, 0.002, 10).at(s) for s in spindles]
        frame += [box(2 * dx + post, 0.022, 0.06, 0.008).at(z=back - 0.05)]
    frame = [solid.turned(x_deg=-lean).at(0, dy, z - thick / 2) for solid in frame]
    seat = box(x, y, thick, rng.uniform(0.004, 0.02), 3).at(z=z - thick)
    return {"seat": [seat], "back": frame, "legs": legs}


@mesh_family("stool")
def stool(rng: np.random.Generator) -> Parts:
    """Round seat on three or four splayed legs with a ring."""
    radius, z, thick = rng.uniform(0.14, 0.2), rng.uniform(0.3, 0.75), rng.uniform(0.025, 0.07)
    count, splay = int(rng.integers(3, 5)), rng.uniform(2, 10)
    leg = (
        turned_post(rng, rng.uniform(0.014, 0.024), z, 14)
        if rng.random() < 0.5
        else cone(0.012, 0.02, z, 0.003, 14)
    )
    drop = leg.at(z=-z).turned(y_deg=splay).at(-radius * 0.7, 0, z - thick / 2)
    legs = [drop.turned(z_deg=360 * k / count) for k in range(count)]
    ring_z = z * rng.uniform(0.25, 0.5)
    reach = radius * 0.7 + np.tan(np.radians(splay)) * (z - ring_z)
    angle = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    ring = sweep(
        np.c_[reach * np.cos(angle), reach * np.sin(angle), np.full(48, ring_z)], 0.008, 10, closed=True
    )
    return {"seat": [cylinder(radius, thick, thick * 0.4, 48).at(z=z - thick)], "legs": legs, "ring": [ring]}


@mesh_family("office_chair")
def office_chair(rng: np.random.Generator) -> Parts:
    """Swivel chair: five castors on a star, gas column, padded seat, bent back in cloth or mesh, arms."""
    x, z, splay = rng.uniform(0.42, 0.52), rng.uniform(0.42, 0.55), rng.uniform(0.26, 0.33)
    s = np.linspace(0, 1, 8)
    leg = np.c_[0.03 + splay * s, 0 * s, 0.11 - 0.045 * s]
    spider = sweep(leg, np.linspace(0.022, 0.014, 8), 10)
    wheel = cylinder(0.027, 0.018, 0.004, 20)
    metal = [cylinder(0.028, z - 0.14, 0.003, 24).at(z=0.1), cylinder(0.05, 0.08, 0.006, 24).at(z=0.07)]
    castors = []
    for k in range(5):
        metal.append(spider.turned(z_deg=72 * k))
        for side in (-0.012, 0.012):
            rolled = wheel.at(z=-0.009).turned(x_deg=90).at(splay + 0.03, side, 0.027)
            castors.append(rolled.turned(z_deg=72 * k))
    seat = pillow(x, x * rng.uniform(0.9, 1.05), rng.uniform(0.09, 0.14), rng.uniform(2.6, 4.5), rng, 4).at(
        z=z
    )
    tall, lean, hollow = rng.uniform(0.4, 0.75), rng.uniform(2, 16), rng.uniform(0.03, 0.09)
    u, v = np.meshgrid(np.linspace(-1, 1, 16), np.linspace(0, 1, 18))
    narrow = 1 - rng.uniform(0, 0.35) * v**3
    bow = hollow * (1 - u**2) - 0.03 * np.sin(np.pi * v) - 0.02
    points = np.stack([u * narrow * x / 2, bow, 0.12 + v * tall], axis=-1)
    pad = rng.uniform(0.02, 0.05)
    back = sheet(points, pad).turned(x_deg=-lean).at(0, x * 0.46, z)
    behind = points[3, 7:9].mean(0) + np.array((0, pad / 2 + 0.01, 0))
    held = rotation_matrix(x_deg=-lean) @ behind + np.array((0, x * 0.46, z))
    stem = np.c_[0 * s, 0.1 + (held[1] - 0.1) * s**0.35, z - 0.05 + (held[2] - z + 0.05) * s**2]
    metal.append(sweep(stem, 0.016, 10))
    parts = {"metal_base": metal, "rubber_castors": castors, "cloth_seat": [seat], "cloth_back": [back]}
    if rng.random() < 0.7:
        t = np.linspace(0, np.pi / 2, 8)
        bend = np.c_[0 * t, -0.04 - 0.05 * np.sin(t), 0.16 + 0.06 * np.cos(t)]
        path = np.vstack(
            [(0, 0.16, 0.22), bend, (0, -0.06, 0.015), (-0.02, -0.06, -0.01), (-0.12, -0.06, -0.01)]
        )
        rest = box(0.06, rng.uniform(0.2, 0.28), 0.03, 0.012, 3).at(0, 0.05, 0.205)
        sides = [
            p.at(side * (x / 2 + 0.035), 0, z)
            for side in (-1, 1)
            for p in (sweep(path * (side, 1, 1), 0.013, 10), rest)
        ]
        parts["plastic_arms"] = sides
    return parts


@mesh_family("armchair")
def armchair(rng: np.random.Generator) -> Parts:
    """Easy chair of bent wood or a wing chair: sloped frame, loose seat and back cushions, arm rests."""
    x, y, z = rng.uniform(0.52, 0.68), rng.uniform(0.52, 0.66), rng.uniform(0.28, 0.38)
    tall, lean, bar = rng.uniform(0.45, 0.75), rng.uniform(10, 26), rng.uniform(0.014, 0.024)
    arm = z + rng.uniform(0.16, 0.26)
    s = np.linspace(0, 1, 18)
    frame = []
    for side in (-1, 1):
        bend = rng.uniform(0.05, 0.14)
        run = np.c_[0 * s, (s - 0.5) * (y + 0.1), arm - bend * (2 * s - 1) ** 4 + 0.02 * np.sin(3 * s)]
        front = np.c_[0 * s[:6], -0.46 * y + 0.02 * s[:6], s[:6] / s[5] * (arm - 0.03)]
        rear = np.c_[0 * s[:6], 0.44 * y - 0.05 * s[:6], s[:6] / s[5] * (arm - 0.03)]
        for path, wide in ((run, 1.7), (front, 1.0), (rear, 1.0)):
            frame.append(sweep(path, bar, 10).stretched(wide, 1, 1).at(side * (x / 2 + bar)))
        rail = box(2 * bar, y, 2.2 * bar, 0.4 * bar).turned(x_deg=6)
        frame.append(rail.at(side * (x / 2 + bar), 0, z - 0.06))
    frame += [box(x, 0.03, 0.045, 0.006).at(0, k * 0.42 * y, z - 0.07 - 0.02 * k) for k in (-1, 1)]
    slats = [
        box(0.035, 0.014, tall + 0.05, 0.004).at(h * x, 0.02, -0.05)
        for h in np.linspace(-0.42, 0.42, rng.integers(4, 9))
    ]
    slats += [box(x, 0.022, 0.05, 0.006).at(0, 0.022, tall - 0.03)]
    back = [p.turned(x_deg=-lean).at(0, 0.4 * y, z - 0.02) for p in slats]
    thick = rng.uniform(0.1, 0.16)
    cushions = [
        pillow(x - 0.01, y * 0.92, thick, rng.uniform(3, 5), rng, 4)
        .turned(x_deg=4)
        .at(0, -0.02, z + 0.35 * thick)
    ]
    rest = pillow(x - 0.02, tall * 0.92, thick, rng.uniform(2.8, 4), rng, 4).turned(x_deg=90 - lean)
    cushions.append(rest.at(0, 0.4 * y - 0.05 + 0.1 * tall, z + 0.55 * thick + 0.46 * tall))
    return {"wood_frame": frame, "wood_back": back, "cloth_cushions": cushions}
