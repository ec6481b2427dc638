"""Tables, desks and benches: a plate on supports."""

from __future__ import annotations

import numpy as np

from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import Solid, box, cone, cylinder, lathe, sweep


@mesh_family("table")
def table(rng: np.random.Generator) -> Parts:
    """Rectangular table: plate, apron, four legs that are square, round or turned."""
    x, y, z = rng.uniform(0.7, 1.8), rng.uniform(0.5, 0.95), rng.uniform(0.4, 0.78)
    plate = rng.uniform(0.018, 0.045)
    inset, width = rng.uniform(0.03, 0.1), rng.uniform(0.035, 0.08)
    dx, dy = x / 2 - inset - width / 2, y / 2 - inset - width / 2
    leg = _leg(rng, width, z - plate)
    legs = [leg.at(sx * dx, sy * dy) for sx in (-1, 1) for sy in (-1, 1)]
    drop = rng.uniform(0.05, 0.1)
    apron = [box(2 * dx, 0.02, drop).at(0, s * dy, z - plate - drop + 0.0008) for s in (-1, 1)]
    apron += [box(0.02, 2 * dy, drop).at(s * dx, 0, z - plate - drop + 0.0016) for s in (-1, 1)]
    top = box(x, y, plate, rng.uniform(0.002, 0.015), 3).at(z=z - plate)
    return {"top": [top], "apron": apron, "legs": legs}


@mesh_family("round_table")
def round_table(rng: np.random.Generator) -> Parts:
    """Round plate on a turned column with a foot or three splayed feet."""
    radius, z = rng.uniform(0.22, 0.6), rng.uniform(0.4, 0.8)
    plate, column = rng.uniform(0.015, 0.04), rng.uniform(0.02, 0.05)
    top = cylinder(radius, plate, rng.uniform(0.003, 0.014), 56).at(z=z - plate)
    shaft = turned_post(rng, column, z - plate - 0.003, 24).at(z=0.003)
    if rng.random() < 0.5:
        foot = [cone(radius * 0.6, column * 1.4, rng.uniform(0.02, 0.06), 0.008, 48)]
    else:
        bend = np.linspace(0, 1, 9)
        reach = np.c_[bend * radius * 0.8, np.zeros(9), 0.02 + 0.25 * z * (1 - bend) ** 1.7]
        foot = [sweep(reach, 0.018, 10).turned(z_deg=120 * k) for k in range(3)]
    return {"top": [top], "column": [shaft], "foot": foot}


@mesh_family("bench")
def bench(rng: np.random.Generator) -> Parts:
    """Slatted garden bench with an optional slatted back."""
    x, seat_z = rng.uniform(0.8, 1.6), rng.uniform(0.38, 0.48)
    count, slat, gap = int(rng.integers(3, 7)), rng.uniform(0.05, 0.09), rng.uniform(0.008, 0.02)
    depth = count * (slat + gap)
    thick = rng.uniform(0.018, 0.03)
    across = (np.arange(count) - (count - 1) / 2) * (slat + gap)
    slats = [box(x, slat, thick, 0.005).at(0, y, seat_z - thick) for y in across]
    posts = [
        box(0.05, 0.05, seat_z - thick).at(sx * (x / 2 - 0.1), sy * (depth / 2 - 0.03))
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    reach = 0.01
    if rng.random() < 0.6:
        height, lean = rng.uniform(0.25, 0.45), rng.uniform(5, 18)
        rows, reach = int(rng.integers(2, 5)), 0.06
        height = max(height, 0.13 + (rows - 1) * (slat + gap) + 0.7 * slat)
        for k in range(rows):
            back = box(x, thick, slat, 0.005).at(z=0.06 + k * (slat + gap) + 0.02)
            slats.append(back.turned(x_deg=-lean).at(0, depth / 2, seat_z))
        posts += [
            box(0.045, 0.035, height)
            .at(0, thick / 2 + 0.0165, -0.05)
            .turned(x_deg=-lean)
            .at(s * (x / 2 - 0.1), depth / 2, seat_z)
            for s in (-1, 1)
        ]
    bearer = box(0.044, depth + reach - 0.02, 0.03).at(y=reach / 2, z=seat_z - thick - 0.029)
    posts += [bearer.at(s * (x / 2 - 0.1)) for s in (-1, 1)]
    return {"slats": slats, "frame": posts}


@mesh_family("desk")
def desk(rng: np.random.Generator) -> Parts:
    """Desk: plate, one side panel, one block of drawers with knobs."""
    x, y, z = rng.uniform(1.0, 1.5), rng.uniform(0.5, 0.75), rng.uniform(0.68, 0.78)
    plate, block, rows = rng.uniform(0.02, 0.04), rng.uniform(0.32, 0.45), int(rng.integers(2, 5))
    body_z = z - plate
    cx, front = x / 2 - block / 2 - 0.02, -y / 2 + 0.04
    body = [box(block, y - 0.08, body_z).at(cx), box(0.03, y - 0.06, body_z).at(-x / 2 + 0.04)]
    step = (body_z - 0.06) / rows
    drawers, knobs = [], []
    for k in range(rows):
        low = 0.04 + k * step
        drawers.append(box(block - 0.03, 0.02, step - 0.012, 0.004).at(cx, front - 0.008, low))
        knob = lathe([(0, 0), (0.008, 0), (0.006, 0.012), (0.014, 0.022), (0.01, 0.03), (0, 0.032)], 16)
        knobs.append(knob.turned(x_deg=90).at(cx, front - 0.018, low + step / 2))
    return {"top": [box(x, y, plate, 0.006).at(z=body_z)], "body": body, "drawers": drawers, "knobs": knobs}


def _leg(rng: np.random.Generator, width: float, height: float) -> Solid:
    kind = rng.integers(3)
    if kind == 0:
        return box(width, width, height, rng.uniform(0.002, 0.012))
    if kind == 1:
        return cone(width * rng.uniform(0.25, 0.5), width / 2, height, 0.004, 20)
    return turned_post(rng, width / 2, height, 20)


def turned_post(rng: np.random.Generator, radius: float, height: float, segments: int) -> Solid:
    """Lathe-turned column: a smooth random profile with a few beads, `radius` at its widest."""
    z = np.linspace(0, 1, 40)
    wave = np.zeros_like(z)
    for k in (1, 2, 3, 5):
        wave += rng.uniform(0.2, 1) * np.cos(2 * np.pi * (k * z + rng.random())) / k
    wave = 0.45 + 0.55 * (wave - wave.min()) / np.ptp(wave)
    for centre in rng.uniform(0.1, 0.9, rng.integers(0, 4)):
        wave += 0.35 * np.exp(-(((z - centre) / 0.02) ** 2))
    profile = np.c_[radius * wave / wave.max(), z * height]
    return lathe([(0, 0), *profile, (0, height)], segments)
