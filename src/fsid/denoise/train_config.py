"""Settings of a training; the YAML files of `fsid/configs` are instances of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from fsid.config import Override, check_fields, load_named
from fsid.dataset.patch_grid import check_shrink
from fsid.denoise.raw_denoiser import MAX_PATCH_PX, NetworkConfig
from fsid.errors import FsidError

_MAX_BATCH_PX = 2**28  # packed pixels, 4 GiB of patches
_MAX_THREADS = 1024  # a system that runs out of them fails anywhere, with messages that make no sense
_MOST_ROWS = 500_000
"""Of loss and validation, which are in the header of a checkpoint; safetensors takes 100 MB of it."""


@dataclass(frozen=True)
class TrainConfig:
    """How to train.

    network: size of the NAFNet. initial_weights: a network to start from (fine-tuning), as a run folder, a
    file or the name of a shipped one; "" starts from random weights. steps: of the optimizer. batch: patches
    per step and process. patch_px: side of a patch in packed pixels (the mosaic patch has twice that).
    shrink: how many times smaller images are made before patches are cut, powers of 2, with as many patches
    of each; empty: 1, 2, 4 ... while the longer side of most images keeps 480 pixels, since a patch shows
    little of a large image. learning_rate: peak; final_rate: end of the cosine as a share of it.
    warmup_steps: linear rise. betas, weight_decay: of AdamW. clip_norm: largest gradient norm. ema_decay: of
    the moving average of the weights, which is the model that is kept. profiles: cameras whose noise is
    drawn, by name or file. iso_min, iso_max: log-uniform range. held_out: images at the end of the dataset,
    as it is when the run begins, that are for validation; with the others of their scenes at most a fifth of
    it. validate_every: steps. validation_photos: a folder of photographs to validate on as well ("" for
    none). seed: of weights, patches and noise. log_every, checkpoint_every: steps. tensorboard: write its
    logs, where it is installed.
    compile: the network with torch.compile; auto does on a GPU. threads: of PyTorch on a CPU, 0 leaves its
    own choice. loader_processes: extra processes that prepare batches (0: none, right on a CPU).
    """

    network: NetworkConfig = field(default_factory=NetworkConfig)
    initial_weights: str = ""
    steps: int = 200_000
    batch: int = 16
    patch_px: int = 64
    shrink: tuple[int, ...] = ()
    learning_rate: float = 1e-3
    final_rate: float = 0.001
    warmup_steps: int = 1000
    betas: tuple[float, float] = (0.9, 0.9)
    weight_decay: float = 0.0
    clip_norm: float = 1.0
    ema_decay: float = 0.999
    profiles: tuple[str, ...] = ("pixel6", "galaxy-s22")
    iso_min: float = 400.0
    iso_max: float = 8000.0
    held_out: int = 8
    validate_every: int = 1000
    validation_photos: str = ""
    seed: int = 0
    log_every: int = 20
    checkpoint_every: int = 500
    tensorboard: bool = True
    compile: Literal["auto", "on", "off"] = "auto"
    threads: int = 0
    loader_processes: int = 0

    def __post_init__(self) -> None:
        check_fields(self)
        for key in ("steps", "batch", "patch_px", "log_every", "checkpoint_every", "validate_every"):
            if getattr(self, key) < 1:
                raise FsidError(f"{key}: must be at least 1, got {getattr(self, key)}")
        for key, most in (
            ("patch_px", MAX_PATCH_PX),
            ("batch", _MAX_BATCH_PX // self.patch_px**2),
            ("threads", _MAX_THREADS),
            ("loader_processes", _MAX_THREADS),
        ):
            if getattr(self, key) > most:
                raise FsidError(f"{key}: must be at most {most}, got {getattr(self, key)}")
        rows = self.steps // self.log_every + self.steps // self.validate_every
        if rows > _MOST_ROWS:
            raise FsidError(
                f"log_every {self.log_every}, validate_every {self.validate_every}: {rows:,} rows of history "
                f"are more than the {_MOST_ROWS:,} that a checkpoint has room for; raise them"
            )
        check_shrink(self.shrink)
        for key in ("learning_rate", "final_rate", "weight_decay"):
            if not 0 <= getattr(self, key) < math.inf:
                raise FsidError(f"{key}: must be finite and not negative, got {getattr(self, key)}")
        for key in ("learning_rate", "clip_norm"):
            if not getattr(self, key) > 0:
                raise FsidError(f"{key}: must be above 0, got {getattr(self, key)}")
        for key in ("warmup_steps", "threads", "loader_processes", "seed", "held_out"):
            if getattr(self, key) < 0:
                raise FsidError(f"{key}: must not be negative, got {getattr(self, key)}")
        if self.seed >= 2**64:
            raise FsidError(f"seed: must be below 2^64, got {self.seed}")
        if not all(0 <= beta < 1 for beta in self.betas):
            raise FsidError(f"betas: must be at least 0 and below 1, got {list(self.betas)}")
        if not 0 <= self.ema_decay < 1:
            raise FsidError(f"ema_decay: must be at least 0 and below 1, got {self.ema_decay}")
        if not 0 < self.iso_min <= self.iso_max < math.inf:
            raise FsidError(
                f"iso_min {self.iso_min}, iso_max {self.iso_max}: must satisfy 0 < iso_min <= iso_max < inf"
            )


def train_config(name_or_file: str | Path, overrides: Sequence[Override] = ()) -> TrainConfig:
    """A built-in configuration by name (`fsid/configs`), or a YAML file; overrides on top."""
    return load_named(TrainConfig, name_or_file, overrides)
