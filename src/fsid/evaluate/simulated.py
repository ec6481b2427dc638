"""The paper's test set as a simulation: ten materials, light levels in lux, one named camera.

    material -> light -> camera RGB -> truth;      lux -> exposure and ISO (`sensor.light`) -> noisy frames

A white sheet in the middle of the picture gets KEY / GREY of saturation, as the camera's auto-exposure sets
it. Noise has all terms of the camera's profile; the fixed ones (banding, fixed pattern) are those of one unit
of the camera.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from fsid.errors import FsidError, whole
from fsid.evaluate.testbench import MATERIALS, simulate
from fsid.evaluate.testset import Progress, TestImage, TestSet, capture, levels_of, listed
from fsid.sensor import Raw, clean_from_linear, load_bayer_profile
from fsid.sensor.light import GREY, KEY
from fsid.sensor.profiles import profiles_digest

LUXES = (0.5, 1.0, 2.0, 5.0)
"""The light levels of the paper."""
_LARGEST_PX = 8192
"""A megapixel takes 0.65 GB to draw."""


def simulated_testset(
    out: str | Path,
    *,
    camera: str | Path,
    luxes: Iterable[float] = (),
    isos: Iterable[float] = (),
    frames: int = 1,
    scenes: int = 3,
    width: int = 1024,
    height: int = 768,
    materials: Iterable[str] = (),
    seed: int = 0,
    progress: Progress = lambda done, total: None,
) -> TestSet:
    """Draw `scenes` pictures of every material and capture `frames` noisy frames of each at every level.

    luxes and isos: the levels, LUXES where neither is given. materials: of MATERIALS, all where none is.
    FsidError for a camera, levels, materials or sizes that cannot be used, or an `out` that is not empty.
    """
    profile = load_bayer_profile(camera)
    isos, luxes = listed(isos, "isos"), listed(luxes, "luxes")
    levels = levels_of(profile, isos, luxes or (() if isos else LUXES))
    materials = listed(materials, "materials") or tuple(MATERIALS)
    if unknown := set(materials) - set(MATERIALS):
        raise FsidError(f"{sorted(unknown)[0]}: no such material; choose from {', '.join(MATERIALS)}")
    scenes, width, height = whole(scenes, "scenes"), whole(width, "width"), whole(height, "height")
    if not (1 <= frames <= 100 and scenes >= 1):
        raise FsidError(f"--frames {frames}: 1 to 100 are possible, and --scenes must be at least 1")
    if min(width, height) < 64 or max(width, height) > _LARGEST_PX or width % 2 or height % 2:
        raise FsidError(f"--width {width} --height {height}: give even numbers of 64 to {_LARGEST_PX} pixels")
    testset = TestSet(
        camera=profile.name,
        levels=tuple(levels),
        images=tuple(TestImage(f"{name}-{n:02d}", name) for name in materials for n in range(scenes)),
        seed=seed,
        notes="drawn materials, light levels by the exposure model, noise from the camera's profile",
        frames=frames,
        profiles_digest=profiles_digest([camera]),
    )

    def truth(rng: np.random.Generator, i: int) -> Raw:
        light = simulate(rng, testset.images[i].set, height, width)
        return clean_from_linear(rng, light * np.float32(KEY / GREY), profile)

    capture(testset, Path(out), profile, levels, truth, progress)
    return testset
