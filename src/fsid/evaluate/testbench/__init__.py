"""The paper's ten test materials, drawn by generators that share no code with the training scenes.

Letters of both are of matplotlib's fonts, which is worth 0.05 dB at most (docs/results.md, Table 2).

simulate(rng, material, height, width) -> (H, W, 3) linear light, 1 = a white sheet in the middle
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from fsid.evaluate.testbench.charts import bar_chart, colour_checker, star_chart, text_page
from fsid.evaluate.testbench.plants import plant_leaves, plastic_flower
from fsid.evaluate.testbench.prints import banknote_and_coins, magazine_page
from fsid.evaluate.testbench.surface import OVERSAMPLING, Surface, light_rand
from fsid.evaluate.testbench.textiles import fabric_patches, threads

MATERIALS: Mapping[str, Callable[[np.random.Generator, int, int], Surface]] = MappingProxyType(
    {
        "star-chart": star_chart,
        "bar-chart": bar_chart,
        "colour-checker": colour_checker,
        "text": text_page,
        "banknote-coins": banknote_and_coins,
        "fabric": fabric_patches,
        "threads": threads,
        "magazine": magazine_page,
        "plastic-flower": plastic_flower,
        "plant-leaves": plant_leaves,
    }
)


def simulate(rng: np.random.Generator, material: str, height: int, width: int) -> np.ndarray:
    """Light from one of `MATERIALS`: (height, width, 3) float32, linear sRGB, 1 = a white sheet."""
    surface = MATERIALS[material](rng, height * OVERSAMPLING, width * OVERSAMPLING)
    return light_rand(rng, surface)


__all__ = ["MATERIALS", "simulate"]
