"""What an experiment is: its sources of training data, its settings, and those of three scales."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Literal

from fsid.config import check_fields
from fsid.dataset import RENDERED, GenerateConfig
from fsid.errors import FsidError
from fsid.evaluate.testbench import MATERIALS
from fsid.evaluate.testset import ALL_SETS
from fsid.scene import VARIANTS

Kind = Literal["ablation", "real-vs-synthetic"]

PHOTOGRAPHS, DEAD_LEAVES, SCENES = "photographs", "dead-leaves", "full"
SOURCES: dict[Kind, tuple[str, ...]] = {
    "ablation": VARIANTS,
    "real-vs-synthetic": (PHOTOGRAPHS, SCENES, DEAD_LEAVES),
}
_PHOTOGRAPH_PX = 1024
"""Windows of photographs are at least so large: small frames suit scenes, but would only cut pictures."""
_NOT_OF_SCENES = {field.name for field in fields(GenerateConfig)} - {*RENDERED, "checks"} | {"variant"}
MATERIALS_SET = "materials"


@dataclass(frozen=True)
class ExperimentConfig:
    """One experiment: with its folder of photographs, everything that its result depends on.

    count: pairs per source, width x height pixels each (photographs: at least every one of the folder, and
    windows of at least 1024 pixels a side where they have them). steps: of every training, 0 takes those of
    the configuration `network` (a built-in name or a YAML file). seeds: one training per source and seed.
    photos: folder to train the real rival on. tests: folders of photographs to measure on, beside the
    simulated materials (materials_scenes pictures of each, test_width x test_height).
    camera: noise profile of data, trainings and tests. settings: `key=value` of the generator that say how
    scenes are, for every source of scenes. train_settings: of every training.
    """

    kind: Kind
    count: int
    steps: int
    network: str
    seeds: tuple[int, ...]
    width: int
    height: int
    camera: str = "pixel6"
    photos: str = ""
    tests: tuple[str, ...] = ()
    materials_scenes: int = 3
    test_width: int = 768
    test_height: int = 576
    settings: tuple[str, ...] = ()
    train_settings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self)
        if min(self.count, self.materials_scenes) < 1 or self.steps < 0 or not self.seeds:
            raise FsidError("--count and --seeds must name at least one, --steps must not be negative")
        if len(set(self.seeds)) < len(self.seeds):
            raise FsidError(f"--seeds {' '.join(map(str, self.seeds))}: give different ones")
        if not all(0 <= seed < 2**64 for seed in self.seeds):
            raise FsidError(f"--seeds {' '.join(map(str, self.seeds))}: must be at least 0 and below 2^64")
        if self.kind == "real-vs-synthetic" and not self.photos:
            raise FsidError("--photos: name the folder of photographs that the real rival is trained on")
        for key in (setting.partition("=")[0] for setting in self.settings):
            if key.partition(".")[0] in _NOT_OF_SCENES:
                raise FsidError(f"--set {key}: is no setting of the scenes alone; rivals share all others")
        names = [MATERIALS_SET, ALL_SETS, *MATERIALS, *map(set_name, self.tests)]
        for folder in self.tests:
            if names.count(name := set_name(folder)) > 1:
                raise FsidError(f"--test {folder}: another test set is called {name}, too; rename the folder")

    def frame_px(self, source: str) -> tuple[int, int]:
        """Width and height of the frames of a source; photographs have them at most."""
        least = _PHOTOGRAPH_PX if source == PHOTOGRAPHS else 0
        return max(self.width, least), max(self.height, least)


def scale_config(kind: Kind, scale: str) -> ExperimentConfig:
    """The settings of a scale: "smoke" (minutes), "cpu" (hours on two cores), "paper" (175,000 pairs)."""
    photos = "." if kind == "real-vs-synthetic" else ""
    if scale == "smoke":
        tiny = (
            "network.width=8",
            "held_out=0",
            "batch=2",
            "patch_px=24",  # of test images of 48 packed pixels, aligned: pooled as a whole, not by pieces
            "warmup_steps=2",
            "validate_every=1000",
        )
        return ExperimentConfig(
            kind, 4, 30, "nafnet-tiny", (0, 1), 128, 96, photos=photos, materials_scenes=1,
            test_width=94, test_height=94, train_settings=tiny,
        )  # fmt: skip
    if scale == "cpu":
        return ExperimentConfig(kind, 800, 6000, "nafnet-tiny", (0, 1), 480, 270, photos=photos)
    if scale == "paper":
        return ExperimentConfig(kind, 175_000, 0, "paper", (0, 1), 1920, 1080, photos=photos)
    raise FsidError(f"--scale {scale}: choose smoke, cpu or paper")


def set_name(folder: str) -> str:
    """What the test set of a folder of photographs is called."""
    return Path(folder).resolve().name
