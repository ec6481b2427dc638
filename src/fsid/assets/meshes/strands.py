"""Strands: grass, hair, fur, wire — fine parallel edges that cross, shade and thin out."""

from __future__ import annotations

import numpy as np

from fsid.assets.forms import sunflower
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import Solid, ball, box, copies, cylinder, rotation_matrix, sheet, sweep, tubes


@mesh_family("tuft")
def tuft(rng: np.random.Generator) -> Parts:
    """Grass blades that bend outwards from one root, with seed heads among them."""
    reach, count = rng.uniform(0.15, 0.45), int(rng.integers(60, 140))
    t = np.linspace(0, 1, 8)
    half = 0.5 * rng.uniform(0.004, 0.012) * (1 - 0.92 * t)
    bend = rng.uniform(0.3, 1.1)
    spine_x, spine_z = bend * t**2 * reach * 0.7, reach * (t - 0.35 * bend * t**2)
    across = np.linspace(-1, 1, 3)
    fold = spine_x[:, None] - 0.3 * half[:, None] * np.abs(across)
    grid = np.stack(np.broadcast_arrays(fold, half[:, None] * across, spine_z[:, None]), axis=-1)
    blade = sheet(grid, 0.0008)
    turns = [
        rotation_matrix(0, rng.uniform(-15, 30), rng.uniform(0, 360)) * rng.uniform(0.4, 1.1)
        for _ in range(count)
    ]
    places = np.c_[rng.normal(0, 0.05 * reach, (count, 2)), np.zeros(count)]
    parts = {"leaf_blades": [copies(blade, np.array(turns), places)]}
    if rng.random() < 0.5:
        stalk = sweep(np.c_[0.5 * spine_x, 0 * t, 1.25 * spine_z], 0.0012, 5)
        k = np.arange(16)
        seed = ball(0.0035, 0).stretched(1, 1, 2.2)
        seeds = copies(
            seed,
            np.array([rotation_matrix(25, 0, 137.5 * i) for i in k]),
            np.c_[
                0.5 * spine_x[-1] + 0.003 * np.cos(2.4 * k),
                0.003 * np.sin(2.4 * k),
                1.25 * spine_z[-1] - 0.003 * k,
            ],
        )
        ears = np.array(turns[:8]) * 1.1
        parts["wood_stalks"] = [copies(s, ears, places[:8]) for s in (stalk, seeds)]
    return parts


@mesh_family("fur")
def fur(rng: np.random.Generator) -> Parts:
    """Hairy ball or pelt: hundreds of strands, combed one way, curled, of two colours."""
    size, count = rng.uniform(0.06, 0.15), int(rng.integers(280, 440))
    flat = rng.uniform(0.35, 1.0)
    d = sunflower(count) + rng.normal(0, 0.03, (count, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    long = size * rng.uniform(0.25, 0.9) * rng.uniform(0.7, 1.1, (count, 1, 1))
    comb = rng.normal(0, 1, 3)
    comb *= rng.uniform(0, 0.45) / np.linalg.norm(comb)
    u = np.linspace(0, 1, 5)[None, :, None]
    aim = d[:, None] + comb * u
    curl, phase = rng.uniform(0, 0.3), rng.uniform(0, 6.3, (count, 1, 1))
    side = np.cross(d, (0.3, 0.2, 0.9))[:, None]
    wave = curl * (np.sin(4 * u + phase) - np.sin(phase)) * side * u
    paths = (d * size)[:, None] * (1, 1, flat) + long * (u * aim + wave)
    widths = np.array((1, 1, 0.9, 0.7, 0.35)) * rng.uniform(0.0006, 0.0014)
    dark = rng.random(count) < rng.uniform(0.1, 0.5)
    return {
        "yarn_fur": [tubes(paths[~dark], widths, 4)],
        "yarn_other": [tubes(paths[dark], widths, 4)],
        "leather_skin": [ball(size, 3).stretched(1, 1, flat)],
    }


@mesh_family("wig")
def wig(rng: np.random.Generator) -> Parts:
    """Hair on a head: long locks that fall, wave or curl from a parting; a stand below.

    Each runs from near the crown over the head to below its middle, and falls from there.
    """
    size, count = rng.uniform(0.08, 0.1), int(rng.integers(110, 160))
    d = sunflower(2 * count)[count:]
    long, wavy, turns = rng.uniform(0.08, 0.3), rng.uniform(0, 0.012), rng.uniform(0.5, 2.0)
    u = np.linspace(0, 1, 15)[None, :, None]
    out = d * (1, 1, 0) / np.hypot(d[:, 0], d[:, 1])[:, None]
    over, below = np.minimum(2.4 * u, 1.0), np.maximum(2.4 * u - 1.0, 0.0) / 1.4
    start = 0.55 * np.arccos(d[:, 2])[:, None, None]
    arc = start + (1.75 - start) * over
    head = 1.05 * size * (np.sin(arc) * out[:, None] + np.cos(arc) * np.array((0, 0, 1.2)))
    fall = long * below * rng.uniform(0.8, 1.1, (count, 1, 1))
    phase = rng.uniform(0, 6.3) + rng.normal(0, 0.5, (count, 1, 1))
    sway = (
        wavy
        * np.minimum(1.6 * below, 1.0)
        * np.concatenate(
            [np.cos(6.3 * turns * u + phase), np.sin(6.3 * turns * u + phase), 0 * (u + phase)], axis=-1
        )
    )
    paths = head - fall * np.array((0, 0, 1)) + sway + rng.normal(0, 0.002, (count, 1, 3))
    hair = tubes(paths, np.array([1, *[1.25] * 12, 0.9, 0.5]) * rng.uniform(0.0025, 0.004), 4)
    skull = ball(size, 3).stretched(1, 1, 1.2)
    stand = [
        cylinder(0.045, long + size, 0.01, 28).at(z=-long - 1.6 * size),
        cylinder(0.09, 0.02, 0.006, 40).at(z=-long - 1.7 * size),
    ]
    return {"yarn_hair": [hair], "head": [skull], "stand": stand}


@mesh_family("wire_mesh")
def wire_mesh(rng: np.random.Generator) -> Parts:
    """Woven wire or netting, bent into a wave, in a frame: see-through, edges against whatever is behind."""
    x, y = rng.uniform(0.15, 0.4), rng.uniform(0.15, 0.4)
    nx, ny = int(rng.integers(9, 20)), int(rng.integers(9, 20))
    wire = rng.uniform(0.06, 0.16) * min(x / nx, y / ny)
    bow, number, skew = rng.uniform(0, 0.06), rng.uniform(0.5, 2), rng.uniform(-0.4, 0.4)

    def surface(u: np.ndarray, v: np.ndarray, over: np.ndarray) -> np.ndarray:
        z = bow * np.cos(2 * np.pi * number * u + 1.7 * v) + over
        return np.stack(np.broadcast_arrays(x * (u + skew * v), y * v, z), axis=-1)

    def threads(across: int, along: int, shift: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        fixed = (np.arange(across)[:, None] + 0.5) / across - 0.5
        way = np.linspace(-0.5, 0.5, 2 * along + 1)[None]
        weave = 1.05 * wire * np.cos(np.pi * (along * (way + 0.5) - 0.5 + np.arange(across)[:, None] + shift))
        return fixed, way, weave

    fixed, way, weave = threads(nx, ny, 0)
    warp = tubes(surface(fixed, way, weave), wire, 4)
    fixed, way, weave = threads(ny, nx, 1)
    weft = tubes(surface(way, fixed, weave), wire, 4)
    t = np.linspace(-0.5, 0.5, 24)
    edges = [sweep(surface(t, 0 * t + s, 0 * t), 3 * wire, 8) for s in (-0.5, 0.5)]
    edges += [sweep(surface(0 * t + s, t, 0 * t), 3 * wire, 8) for s in (-0.5, 0.5)]
    tilt = rng.uniform(0, 90)
    parts = {"metal_warp": [warp], "metal_weft": [weft], "frame": edges}
    return {name: [p.turned(x_deg=tilt) for p in solids] for name, solids in parts.items()}


@mesh_family("hedgehog")
def hedgehog(rng: np.random.Generator) -> Parts:
    """Ball of straight spikes: pins in a cushion, a burr, a sea urchin."""
    size, count = rng.uniform(0.03, 0.09), int(rng.integers(90, 210))
    d = sunflower(2 * count)[int(count * rng.uniform(0, 0.9)) :][:count] * (1, 1, -1)
    long = size * rng.uniform(0.3, 1.6)
    ends = d[:, None] * (
        size * 0.92 + np.linspace(0, 1, 4)[None, :, None] * long * rng.uniform(0.7, 1, (count, 1, 1))
    )
    ends[:, 1:] += rng.normal(0, 0.04, (count, 1, 3)) * long * np.linspace(0.3, 1, 3)[None, :, None]
    thick = rng.uniform(0.015, 0.05) * size
    spikes = tubes(ends, thick * np.array((1, 0.8, 0.5, 0.25)), 5)
    parts: dict[str, list[Solid]] = {"body": [ball(size, 3)], "spikes": [spikes]}
    if rng.random() < 0.4:
        knob = ball(2.2 * thick, 0)
        parts["plastic_heads"] = [copies(knob, np.repeat(np.eye(3)[None], count, 0), ends[:, -1])]
    return parts


@mesh_family("loom")
def loom(rng: np.random.Generator) -> Parts:
    """Strings across a frame: a small harp, a loom, a rack of wires, some of them slack."""
    x, z = rng.uniform(0.2, 0.5), rng.uniform(0.25, 0.6)
    count, thick = int(rng.integers(12, 50)), rng.uniform(0.0006, 0.0018)
    slope = rng.uniform(0, 0.6)
    u = np.linspace(-0.46, 0.46, count)
    high = z * (1 - slope * (u + 0.5))
    t = np.linspace(0, 1, 7)[None]
    slack = np.abs(rng.normal(0, 0.02, (count, 1))) * (rng.random((count, 1)) < 0.3)
    paths = np.stack(
        np.broadcast_arrays(
            x * u[:, None] + slack * np.sin(np.pi * t),
            0.6 * slack * np.sin(2 * np.pi * t),
            0.02 + high[:, None] * t,
        ),
        axis=-1,
    )
    even = np.arange(count) % int(rng.integers(2, 5)) == 0
    wide = rng.uniform(0.02, 0.035)
    top = np.array(
        [(px, 0.0, 0.02 + z * (1 - slope * (px / x + 0.5))) for px in np.linspace(-0.52, 0.52, 12) * x]
    )
    frame = [box(1.12 * x, wide * 1.6, 0.028, 0.004), sweep(top, wide / 2, 10)]
    frame += [
        cylinder(wide / 2, float(top[k, 2]) - 0.004, 0.003, 16).at(float(top[k, 0]), 0, 0.004)
        for k in (0, -1)
    ]
    return {
        "yarn_strings": [tubes(paths[~even], thick, 5)],
        "metal_strings": [tubes(paths[even], 1.5 * thick, 5)],
        "wood_frame": frame,
    }
