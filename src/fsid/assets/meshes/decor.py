"""What stands on furniture: vessels, lamps, plants, frames, screens, fruit, stones."""

from __future__ import annotations

import numpy as np

from fsid.assets.forms import scatter_rand
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import (
    ball,
    ball_directions,
    box,
)


@mesh_family("stones")
def stones(rng: np.random.Generator) -> Parts:
    """Angular to round stones: balls cut by random planes."""
    count, size = int(rng.integers(1, 4)), rng.uniform(0.04, 0.15)
    d = ball_directions(4)
    out = []
    for dx, dy in scatter_rand(rng, count, 1.7 * size):
        planes = rng.normal(size=(int(rng.integers(8, 30)), 3))
        planes /= np.linalg.norm(planes, axis=1, keepdims=True)
        facing = np.clip(d @ planes.T, 1e-3, None)
        radii = np.minimum(1.05, (rng.uniform(0.55, 0.95, len(planes)) / facing).min(1))
        rough = sum(np.sin(d @ rng.normal(0, 9, 3) + rng.uniform(0, 6.3)) for _ in range(8))
        stone = ball(size * rng.uniform(0.5, 1) * (radii + 0.006 * rough), 4)
        out.append(
            stone.stretched(1, 1, rng.uniform(0.5, 1)).turned(*rng.uniform(0, 360, 3)).at(dx, dy, size * 0.6)
        )
    return {"stone": out}


@mesh_family("picture_frame")
def picture_frame(rng: np.random.Generator) -> Parts:
    """Framed picture with a mount, standing upright with a slight lean."""
    x, z, wide, deep = (
        rng.uniform(0.15, 0.6),
        rng.uniform(0.15, 0.6),
        rng.uniform(0.01, 0.05),
        rng.uniform(0.012, 0.03),
    )
    round_ = rng.uniform(0.002, 0.3 * wide)
    frame = [box(x, deep, wide, round_, 3).at(z=s) for s in (0, z - wide)]
    frame += [box(wide, deep, z - 2 * wide, round_, 3).at(s * (x - wide) / 2, 0, wide) for s in (-1, 1)]
    mount = box(x - wide, 0.004, z - wide, 0.001, 1).at(z=wide / 2)
    border = rng.uniform(0.1, 0.3) * min(x, z)
    picture = box(x - wide - border, 0.003, z - wide - border, 0.0005, 1).at(0, -0.002, (wide + border) / 2)
    lean = rng.uniform(0, 12)
    parts = {"frame": frame, "mount": [mount], "picture": [picture]}
    return {name: [s.turned(x_deg=-lean) for s in solids] for name, solids in parts.items()}


@mesh_family("monitor")
def monitor(rng: np.random.Generator) -> Parts:
    """Flat screen on a stand, with a bezel around the display."""
    x = rng.uniform(0.4, 0.75)
    z, rim, lift = x * rng.uniform(0.5, 0.65), rng.uniform(0.006, 0.02), rng.uniform(0.06, 0.16)
    tilt = rng.uniform(-4, 12)
    shell = [box(x, 0.03, z, 0.006, 3)]
    shell += [box(x, 0.008, rim, 0.002).at(0, -0.017, low) for low in (0, z - rim)]
    shell += [box(rim, 0.008, z, 0.002).at(s * (x - rim) / 2, -0.017) for s in (-1, 1)]
    display = box(x - 2 * rim, 0.003, z - 2 * rim, 0.0005, 1).at(0, -0.0158, rim)
    stand = [box(0.05, 0.02, lift + z * 0.5, 0.005).at(0, 0.03), box(0.26, 0.2, 0.012, 0.005, 3).at(0, 0.02)]
    return {
        "shell": [s.turned(x_deg=-tilt).at(z=lift) for s in shell],
        "display": [display.turned(x_deg=-tilt).at(z=lift)],
        "stand": stand,
    }
