"""How the network should be told the noise: python bench/conditioning.py DATA -o OUT [--steps N].

Trains one tiny NAFNet per seed and way (stabilise, k-sigma, noise-map; `fsid.denoise.conditioning`) on the
clean mosaics of DATA, all with the same patches, noise, loss and schedule, and prints the RAW PSNR per ISO on
six photographs (`fsid.denoise.probes`). Run it again with the same OUT to go on where it was stopped. The
defaults, 1,500 steps and two seeds, take about 15 minutes of one core.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from fsid.denoise import NetworkConfig, TrainConfig, load_denoiser, train
from fsid.denoise.conditioning import Conditioning
from fsid.denoise.probes import CALIBRATED, ISOS, MEASURED, mean_psnr, probes

WAYS: tuple[Conditioning, ...] = ("stabilise", "k-sigma", "noise-map")
NETWORK = NetworkConfig(width=16, encoder_blocks=(1, 1), middle_blocks=1, decoder_blocks=(1, 1))


def config(way: Conditioning, seed: int, steps: int) -> TrainConfig:
    return TrainConfig(
        network=replace(NETWORK, conditioning=way),
        steps=steps,
        batch=4,
        patch_px=64,
        learning_rate=4e-3,
        warmup_steps=min(100, steps // 4),
        ema_decay=0.99,
        held_out=4,
        validate_every=steps,
        checkpoint_every=100,
        tensorboard=False,
        threads=1,
        seed=seed,
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=1500)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    given = parser.parse_args()
    measured = probes((*MEASURED, *CALIBRATED))
    table = Table("conditioning", "seed", *(f"ISO {iso}" for iso in ISOS), "mean")
    for seed in given.seeds:
        for way in WAYS:
            run = given.output / f"{way}-{seed}-{given.steps}"
            network = load_denoiser(train(given.data, run, config(way, seed, given.steps), quiet=True))
            scores = [mean_psnr(network, [p for p in measured if p.noisy.iso == iso]) for iso in ISOS]
            row = way, str(seed), *(f"{score:.2f}" for score in (*scores, np.mean(scores)))
            print(*row, flush=True)
            table.add_row(*row)
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
