"""What a change of training data would do for photographs: what_if.py RUN SCENES --photos A --test B ...

    python bench/what_if.py run scenes --photos bsds --test cbsd68 mcmaster [--other changed-scenes ...]

RUN is a training that has ended (`fsid train`), everything else a dataset (`fsid generate`, of scenes or,
with --images, of photographs). The run goes on for 150 steps of 8 patches: on SCENES as they are, which is
what all else is compared with, on photographs (how much there is to gain), on SCENES altered in one way each,
and on other datasets. Places, levels and draws of noise are the same every time, and so are those of the
patches that the resulting networks are tested on, so thousandths of a decibel show in a minute. --cut 16
trains on pieces of 16 packed pixels: what is still gained then is local.

Three figures per test: dB more on the mean patch, on the median one, and by the summed errors of all, which
is what the PSNR of whole pictures goes by. In the first a plain patch counts as much as a detailed one, so
they part where a change helps plain ground at the cost of detail.

Unlike the gradient's first order this sees what a change costs as well, but still only where a training of
that length would go, and nothing of how fast a network learns from nothing: frames of 1920x1080 are as good
here as those of 960x540, and train worse (docs/rounds/size-of-frames.md). Train to know (docs/rounds.md).
"""

from __future__ import annotations

import argparse
import copy
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from rich.table import Table
from scipy.ndimage import gaussian_filter
from torch import Tensor

from fsid.config import load_settings
from fsid.dataset.loader import Batch, PatchConfig, PatchDataset
from fsid.denoise.checkpoint import load_checkpoint
from fsid.denoise.raw_denoiser import RawDenoiser
from fsid.denoise.run_folder import CONFIG_FILE
from fsid.denoise.stabilise import stabilise
from fsid.denoise.train import noise_left
from fsid.denoise.train_config import TrainConfig
from fsid.errors import FsidError

Alteration = Callable[[np.ndarray], np.ndarray]
_BATCH, _TEST_BATCH, _TEST_BATCHES = 8, 24, 14
_FLOOR = 0.002
"""Added before the logarithm: noise hides what is darker anyway."""
_NEUTRAL = np.log(np.array([0.484, 1.0, 1.0, 0.505], np.float32))[:, None, None]
"""R, Gr, Gb, B of grey in daylight relative to green: the median of unprocessed photographs, Pixel 6."""


def _logs(x: np.ndarray) -> np.ndarray:
    return np.log(np.maximum(x, 0) + _FLOOR)


def _values(logs: np.ndarray) -> np.ndarray:
    return np.clip(np.exp(logs) - _FLOOR, 0, 1)


def _blur(planes: np.ndarray, sigma_px: float) -> np.ndarray:
    sigmas = (0,) * (planes.ndim - 2) + (sigma_px, sigma_px)
    return gaussian_filter(planes, sigmas, mode="nearest")


def _luma(x: np.ndarray) -> np.ndarray:
    """(B, 1, h, w) mean of the four logarithms."""
    return _logs(x).mean(1, keepdims=True)


def _from_mean(planes: np.ndarray) -> np.ndarray:
    return planes - planes.mean((2, 3), keepdims=True)


def _times_luma(x: np.ndarray, gain: float, fine_px: float, coarse_px: float) -> np.ndarray:
    """Luma between two Gaussians, packed pixels, `gain` times; fine_px 0: from the finest on."""
    luma = _luma(x)
    fine = _blur(luma, fine_px) if fine_px else luma
    return _values(_logs(x) + (gain - 1) * (fine - _blur(luma, coarse_px)))


def _coupled(x: np.ndarray, red: float, blue: float) -> np.ndarray:
    """Red and blue of 1 + `red` and 1 + `blue` times the contrast of luma, about the mean of the patch."""
    slopes = np.array([red, 0, 0, blue])[:, None, None]
    return _values(_logs(x) + slopes * _from_mean(_luma(x)))


def _times_colour(x: np.ndarray, gain: float) -> np.ndarray:
    """Colour that does not go with luma within the patch, `gain` times."""
    light, colour = (_from_mean(_blur(part, 1.0)) for part in (_luma(x), _logs(x) - _luma(x)))
    slope = (light * colour).mean((2, 3), keepdims=True) / ((light**2).mean((2, 3), keepdims=True) + 1e-6)
    return _values(_logs(x) + (gain - 1) * (colour - slope * light))


def _paler_lights(x: np.ndarray, share: float) -> np.ndarray:
    """Lighter detail less saturated, darker detail more: against the colour of its surroundings."""
    luma = _luma(x)
    saturation = _blur(_logs(x) - luma, 8.0) - (_NEUTRAL - _NEUTRAL.mean())
    return _values(_logs(x) - share * (luma - _blur(luma, 8.0)) * saturation)


def _speckled(x: np.ndarray, amount: float) -> np.ndarray:
    """Every value times a factor of its own, of standard deviation `amount`."""
    seed = int(1e6 * float(x[0, 0, :8, :8].sum()))
    return _values(_logs(x) + amount * np.random.default_rng(seed).standard_normal(x.shape))


ALTERATIONS: dict[str, Alteration] = {
    "red and blue 0.94 times the contrast of green": lambda x: _coupled(x, -0.06, -0.06),
    "red 1.06 times": lambda x: _coupled(x, 0.06, 0.0),
    "blue 1.06 times": lambda x: _coupled(x, 0.0, 0.06),
    "colour beside luma 0.8 times": lambda x: _times_colour(x, 0.8),
    "colour beside luma 1.25 times": lambda x: _times_colour(x, 1.25),
    "lighter detail paler, 0.25": lambda x: _paler_lights(x, 0.25),
    "lighter detail paler, 0.5": lambda x: _paler_lights(x, 0.5),
    "luma finer than 1 px 0.8 times": lambda x: _times_luma(x, 0.8, 0.0, 1.0),
    "luma of 1 to 4 px 1.3 times": lambda x: _times_luma(x, 1.3, 1.0, 4.0),
    "blurred by 0.4 px": lambda x: _blur(x, 0.4),
    "0.8 % of speckle": lambda x: _speckled(x, 0.008),
    "1.6 % of speckle": lambda x: _speckled(x, 0.016),
    "0.7 times as bright": lambda x: 0.7 * x,
}
"""Name -> what it makes of clean packed patches (B, 4, h, w), 0..1. Lengths in packed pixels."""


class Continued:
    """A trained network, and what becomes of it after some more steps."""

    def __init__(
        self, run: Path, tests: list[Path], steps: int, rate: float, cut_px: int | None = None
    ) -> None:
        self.config = load_settings(TrainConfig, run / CONFIG_FILE)
        self._steps, self._rate = steps, rate
        self._cut_px = self.config.patch_px if cut_px is None else cut_px
        if not 1 <= self._cut_px <= self.config.patch_px:
            raise FsidError(f"--cut: {cut_px} is not within 1 to {self.config.patch_px}, the side of a patch")
        self._net = RawDenoiser(self.config.network)
        optimizer = self._optimizer()
        state = load_checkpoint(run, self._net, optimizer)
        if state.step == 0:
            raise FsidError(f"{run}: holds no checkpoint")
        self._start, self._moments = copy.deepcopy(state.average), copy.deepcopy(optimizer.state_dict())
        self._tests = [list(self._batches(test, _TEST_BATCH, _TEST_BATCHES, seed=99)) for test in tests]
        self.noise = [np.concatenate([batch.k[:, 0].numpy() for batch in test]) for test in self._tests]
        """How noisy the patches of each test are: k of their first plane."""

    def psnr(self, data: Path, alter: Alteration | None = None) -> list[np.ndarray]:
        """PSNR in dB of every test patch, noise of variance 1, per test, after training on `data`."""
        self._net.load_state_dict(self._start)
        optimizer = self._optimizer()
        optimizer.load_state_dict(copy.deepcopy(self._moments))
        mean, kept = {name: torch.zeros_like(w) for name, w in self._start.items()}, 0
        for step, batch in enumerate(self._batches(data, _BATCH, self._steps, seed=5)):
            batch = _cut(batch, self._cut_px)
            clean, noisy = batch.clean, batch.noisy
            if alter:
                clean, noisy = _altered(batch, alter)
            optimizer.zero_grad()
            noise_left(
                self._net(noisy, batch.k, batch.sigma2).float(), clean, batch.k, batch.sigma2
            ).backward()
            torch.nn.utils.clip_grad_norm_(self._net.parameters(), self.config.clip_norm)
            optimizer.step()
            if step >= self._steps // 3:
                kept += 1
                for name, weight in self._net.state_dict().items():
                    mean[name] += (weight - mean[name]) / kept
        self._net.load_state_dict(mean)
        with torch.no_grad():
            return [np.concatenate([self._patches_psnr(b) for b in test]) for test in self._tests]

    def _patches_psnr(self, batch: Batch) -> np.ndarray:
        k, sigma2 = batch.k[:, :, None, None], batch.sigma2[:, :, None, None]
        estimate = self._net(batch.noisy, batch.k, batch.sigma2)
        error = stabilise(estimate, k, sigma2) - stabilise(batch.clean, k, sigma2)
        return np.asarray(-10 * torch.log10(error.square().mean((1, 2, 3))))

    def _optimizer(self) -> torch.optim.Optimizer:
        c = self.config
        return torch.optim.AdamW(
            self._net.parameters(), lr=self._rate, betas=c.betas, weight_decay=c.weight_decay
        )

    def _batches(self, data: Path, size: int, count: int, seed: int) -> Iterator[Batch]:
        c = self.config
        patches = PatchConfig(c.patch_px, size, c.profiles, c.iso_min, c.iso_max)
        dataset = PatchDataset(data, patches, seed=seed)
        return (dataset[step] for step in range(count))


def _cut(batch: Batch, size_px: int) -> Batch:
    """Every patch (h, w) as floor(h/size) x floor(w/size) patches of `size_px` packed pixels."""
    rows, columns = (side // size_px for side in batch.clean.shape[2:])

    def pieces(patches: Tensor) -> Tensor:
        tiles = patches.unfold(2, size_px, size_px).unfold(3, size_px, size_px)
        return tiles.permute(0, 2, 3, 1, 4, 5).flatten(0, 2)

    return Batch(
        pieces(batch.noisy),
        pieces(batch.clean),
        batch.k.repeat_interleave(rows * columns, 0),
        batch.sigma2.repeat_interleave(rows * columns, 0),
    )


def _altered(batch: Batch, alter: Alteration) -> tuple[Tensor, Tensor]:
    """The batch's patches, altered, with the same draw of noise: clean, noisy."""
    k, sigma2 = batch.k[:, :, None, None], batch.sigma2[:, :, None, None]
    noise = (batch.noisy - batch.clean) / (k * batch.clean + sigma2).sqrt()
    clean = torch.from_numpy(alter(batch.clean.numpy()).astype(np.float32))
    return clean, clean + noise * (k * clean + sigma2).sqrt()


def summed_db(better: np.ndarray, plain: np.ndarray, noise: np.ndarray) -> float:
    """How much less the summed error of patches is, dB: the mean over four equal parts of them by `noise`,
    since PSNR is taken per level. better, plain: (N,) PSNR of every patch, dB. noise: (N,) its k."""
    quarter = np.digitize(noise, np.quantile(noise, (0.25, 0.5, 0.75)))
    old, new = (np.bincount(quarter, 10 ** (-psnr / 10)) for psnr in (plain, better))
    return float((10 * np.log10(old / new)).mean())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path)
    parser.add_argument("scenes", type=Path)
    parser.add_argument("--photos", type=Path, required=True, help="what there is to gain")
    parser.add_argument("--test", type=Path, nargs="+", required=True, help="what is measured on")
    parser.add_argument("--other", type=Path, nargs="*", default=[], help="datasets to train on instead")
    parser.add_argument("--steps", type=int, default=150, help="of training (default 150)")
    parser.add_argument("--learning-rate", type=float, default=2e-4, help="constant (default 2e-4)")
    parser.add_argument("--cut", type=int, help="train on pieces of so many packed pixels (default: whole)")
    parser.add_argument(
        "--altered", action=argparse.BooleanOptionalAction, default=True, help="try the alterations (default)"
    )
    given = parser.parse_args()
    console = Console()
    try:
        run = Continued(given.run, given.test, given.steps, given.learning_rate, given.cut)
        plain = run.psnr(given.scenes)
        rows: list[tuple[str, Path, Alteration | None]] = [("photographs", given.photos, None)]
        rows += [(name, given.scenes, alter) for name, alter in ALTERATIONS.items() if given.altered]
        rows += [(str(other), other, None) for other in given.other]
        columns = [f"{test.name}: mean, median, sum" for test in given.test]
        table = Table("instead of scenes as they are, dB more", *columns)
        for name, data, alter in rows:
            results = run.psnr(data, alter)
            console.print(f"{name} ...", style="dim")
            figures = []
            for better, before, noise in zip(results, plain, run.noise, strict=True):
                more = better - before
                deviation = more.std() / np.sqrt(len(more))
                mean, summed = f"{more.mean():+.3f} ± {deviation:.3f}", summed_db(better, before, noise)
                figures.append(f"{mean}, {np.median(more):+.3f}, {summed:+.3f}")
            table.add_row(name, *figures)
    except FsidError as problem:
        parser.error(str(problem))
    console.print(table)


if __name__ == "__main__":
    main()
