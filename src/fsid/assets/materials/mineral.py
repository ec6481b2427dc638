"""Stone and masonry: marble, granite, terrazzo, concrete, brick, tiles."""

from __future__ import annotations

import numpy as np

from fsid.assets.material_registry import Layers, material_family
from fsid.assets.patterns import axes, cells, edge, grid, joint, level, noise, scratches


@material_family(
    "marble",
    tile_m=0.8,
    relief_m=0.0002,
    colours=(
        "e6e2dc d2ccc4 7a7672",
        "d8d0c4 c0b4a4 8a5a44",
        "3a3d40 55585c d9d6d0",
        "5f7064 7f9084 e0e0d8",
    ),
)
def marble(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Veins are the zero crossings of noise, thin and of three scales, over clouded ground."""
    cloud = noise(rng, size, 1.7)
    thickness = np.exp(0.6 * noise(rng, size, 1.5, high=20))
    veins = np.zeros_like(cloud)
    for scale, width, depth in ((2, 0.05, 1.0), (5, 0.03, 0.8), (12, 0.02, 0.5)):
        ridge = np.abs(noise(rng, size, 1.7 + 0.1 * variant, low=scale))
        veins = np.maximum(veins, np.exp(-ridge / (width * thickness)) * depth)
    crystal = noise(rng, size, 0.2, low=size / 10)
    return Layers(
        mix=level(cloud + 0.15 * crystal),
        pattern=0.9 * veins,
        detail=0.5 + 0.02 * crystal + 0.03 * cloud,
        roughness=0.14 + 0.03 * crystal + 0.1 * veins,
        height=0.8 - 0.3 * veins + 0.02 * crystal,
    )


@material_family(
    "granite",
    tile_m=0.3,
    relief_m=0.0006,
    colours=(
        "b0a8a0 8a8480 2f2c2c",
        "c09a8c a57a6e 3a302e",
        "7a8288 9aa0a4 22262a",
        "d0ccc4 b5b0a8 5a4a42",
    ),
)
def granite(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Interlocking grains of three minerals, some of one texel."""
    shift = 0.3 * np.stack([noise(rng, size, 1.6, low=20, high=300) for _ in range(2)])
    _, _, coarse = cells(rng, size, (40, 60, 90, 30)[variant], 0.95, shift)
    fine = noise(rng, size, 0.4, low=size / 16)
    cloud = noise(rng, size, 1.6, low=2)
    return Layers(
        mix=np.clip(coarse + 0.12 * fine, 0, 1),
        pattern=np.maximum(edge(coarse + 0.05 * cloud, 0.82, 0.04), edge(fine, 2.1, 0.4)),
        detail=0.5 + 0.06 * fine + 0.02 * cloud,
        roughness=0.25 + 0.25 * coarse,
        height=0.5 + 0.3 * (coarse - 0.5) + 0.05 * fine,
    )


@material_family(
    "terrazzo",
    tile_m=0.6,
    relief_m=0.0003,
    colours=(
        "d8d2c6 a89a88 5f5a56",
        "c2b8ac e0dcd4 8a4a3a",
        "e8e4dc 9aa59c 3f5a52",
        "7a7672 b5aea4 e0d8cc",
    ),
)
def terrazzo(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Angular chips of two sizes in a cement ground, polished."""
    shift = 0.12 * np.stack([noise(rng, size, 2.0, low=8, high=150) for _ in range(2)])
    near, second, value = cells(rng, size, (16, 24, 34, 12)[variant], 0.95, shift)
    big = edge(second - near, 0.08 + 0.5 * (1 - value), 0.03) * (value > 0.35)
    near, second, small_value = cells(rng, size, 96, 0.95, shift)
    small = edge(second - near, 0.35, 0.1) * (small_value > 0.55) * (1 - big)
    sand = noise(rng, size, 0.3, low=size / 12)
    return Layers(
        mix=np.where(big > small, value * 1.6 - 0.6, np.where(small > 0.5, small_value, 0.15 + 0.04 * sand)),
        pattern=0.85 * np.maximum(big * ((value * 7) % 1 > 0.45), small * ((small_value * 9) % 1 > 0.5)),
        detail=0.5 + 0.035 * sand * (1 - 0.6 * big),
        roughness=0.2 + 0.08 * (1 - big) + 0.02 * sand,
        height=0.6 + 0.2 * big + 0.1 * small + 0.04 * sand,
    )


@material_family("concrete", tile_m=1.2, relief_m=0.003, colours="9a9892 b0aea6 6b6862")
def concrete(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Cast concrete: cement stains, air holes, sand grains of a texel, hair cracks, formwork joints."""
    stains = noise(rng, size, 1.6)
    sand = noise(rng, size, 0.2, low=size / 10)
    holes = edge(noise(rng, size, 0.6, low=30, high=120), 2.2, 0.4)
    bend = np.abs(noise(rng, size, 1.5, low=2))
    cracks = np.exp(-bend / 0.012) * edge(noise(rng, size, 2.0, low=1, high=6), 0.4, 0.6)
    boards = (0, 4, 6, 0)[variant]
    _, v = axes(size)
    joint = edge(np.abs((v * boards) % 1 - 0.5), 0.492, 0.012) if boards else np.float32(0)
    dark = np.clip(holes + cracks + 0.6 * joint, 0, 1)
    return Layers(
        mix=level(stains + 0.25 * sand),
        pattern=0.5 * edge(stains, 1.3, 1.0) + 0.3 * dark,
        detail=0.5 + 0.045 * sand + 0.03 * stains - 0.22 * dark,
        roughness=0.8 + 0.06 * sand,
        height=0.8 + 0.03 * sand + 0.03 * stains - 0.7 * dark,
    )


@material_family(
    "brick",
    tile_m=1.0,
    relief_m=0.012,
    colours=(
        "9a4a38 b5694f c2b8a8",
        "8a3f30 a85a45 d0c8bc",
        "c39b74 d6bb96 8b8174",
        "7a5a4a 94705c b0a89c",
    ),
)
def brick(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Running bond with rough mortar; every brick has its own shade and broken edges."""
    rows, columns = (14, 12, 16, 10)[variant], (4, 4, 8, 3)[variant]
    u, v = axes(size)
    ragged = noise(rng, size, 1.2, low=10, high=200)
    grit = noise(rng, size, 0.35, low=size / 16)
    y = v * rows + 0.03 * ragged
    row = np.floor(y).astype(int) % rows
    x = (u * columns + 0.5 * (row % 2) + 0.02 * ragged.T) % columns
    column = np.floor(x).astype(int) % columns
    shade = rng.random((rows, columns))[row, column]
    border = np.minimum(0.5 - np.abs(y % 1 - 0.5), (0.5 - np.abs(x % 1 - 0.5)) * (rows / columns))
    face = edge(border, 0.075, 0.05)
    chips = edge(ragged + 0.4 * grit, 1.9, 0.4) * face
    return Layers(
        mix=np.clip(face * level(1.8 * (shade - 0.5) + 0.5 * ragged + 0.2 * grit), 0, 1),
        pattern=1 - face + 0.4 * chips,
        detail=0.5 + 0.06 * grit + face * 0.16 * (shade - 0.5) - 0.1 * chips,
        roughness=0.85 + 0.05 * grit,
        height=face * (0.75 + 0.12 * shade + 0.05 * ragged) + 0.04 * grit + 0.1 - 0.15 * chips,
    )


@material_family("tiles", tile_m=0.9, relief_m=0.003)
def tiles(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Glazed tiles with grout: plain, mosaic, quarter-circle (Truchet) and star motifs."""
    count = (6, 24, 8, 6)[variant]
    x, y, i, j = grid(size, count, count)
    shade = rng.random((count, count))[j, i]
    grout = joint(np.maximum(np.abs(x), np.abs(y)), 0.478, 0.02, count / size)
    flip = rng.random((count, count))[j, i] < 0.5
    a = np.where(flip, x, -x)
    ring = np.minimum(np.hypot(a - 0.5, y - 0.5), np.hypot(a + 0.5, y + 0.5))
    angle = np.arctan2(y, x)
    motif = (
        0.0 * ring,
        edge(shade, 0.75, 0.01),
        edge(0.12 - np.abs(ring - 0.5), 0, 0.012) - 0.6 * edge(0.04 - np.abs(ring - 0.5), 0, 0.012),
        edge(0.3 + 0.1 * np.cos(8 * angle) - np.hypot(x, y), 0, 0.012)
        - edge(0.13 + 0.05 * np.cos(4 * angle) - np.hypot(x, y), 0, 0.012),
    )[variant]
    glaze = noise(rng, size, 1.6, low=3)
    grain = noise(rng, size, 0.3, low=size / 12)
    crazing = scratches(rng, size, 220, 0.03) * (variant in (0, 3))
    return Layers(
        mix=np.clip(0.25 * level(glaze) + (0.25, 0.9, 0.3, 0.3)[variant] * shade + 0.5 * grout, 0, 1),
        pattern=np.clip(motif * (1 - grout), 0, 1) * 0.95,
        detail=0.5 + 0.01 * glaze + grout * (0.05 * grain - 0.15) - 0.08 * crazing + 0.004 * grain,
        roughness=0.1 + 0.04 * level(glaze) + 0.7 * grout,
        height=(1 - grout) * (0.9 + 0.02 * glaze) - 0.03 * crazing + grout * 0.05 * grain,
    )
