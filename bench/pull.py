"""Which change of training data would pull a network towards photographs: pull.py RUN PHOTOS DATA ...

    python bench/pull.py run pairs-of-photographs scenes [--batches 60]

RUN is a training that has ended (`fsid train`); PHOTOS and DATA are datasets (`fsid generate photographs`,
`fsid generate scenes`). A step of training on photographs would change the network's weights in some
direction: minus the gradient of the loss, each weight's divided by AdamW's running root mean square of it.
The pull of other patches is how far their gradient goes that way, in percent of how far another half of the
photographs goes. The patches of DATA are altered in one way each, with the same noise, so differences are
known far better than the pulls themselves (their standard error over batches is given).

This is the first order: where a change pulls, training with it may help. Train to know (docs/rounds.md).
"""

from __future__ import annotations

import argparse
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
from fsid.denoise.train import CONFIG_FILE, noise_left
from fsid.denoise.train_config import TrainConfig
from fsid.errors import FsidError

Alteration = Callable[[np.ndarray], np.ndarray]
_BATCH = 24
_FLOOR = 0.002
"""Added before the logarithm: noise hides what is darker anyway."""


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


def _from_mean(luma: np.ndarray) -> np.ndarray:
    return luma - luma.mean((2, 3), keepdims=True)


def _times_luma(x: np.ndarray, gain: float, fine_px: float, coarse_px: float) -> np.ndarray:
    """Luma between two Gaussians, packed pixels, `gain` times; fine_px 0: from the finest on."""
    luma = _luma(x)
    fine = _blur(luma, fine_px) if fine_px else luma
    return _values(_logs(x) + (gain - 1) * (fine - _blur(luma, coarse_px)))


def _coupled(x: np.ndarray, red: float, blue: float) -> np.ndarray:
    slopes = np.array([red, 0, 0, blue])[:, None, None]
    return _values(_logs(x) + slopes * _from_mean(_luma(x)))


def _times_hues(x: np.ndarray, gain: float) -> np.ndarray:
    """Smooth colour, each plane's logarithm against luma, `gain` times about its mean."""
    colour = _blur(_logs(x) - _luma(x), 1.5)
    return _values(_logs(x) + (gain - 1) * (colour - colour.mean((2, 3), keepdims=True)))


ALTERATIONS: dict[str, Alteration] = {
    "as it is": lambda x: x,
    "red and blue 1.06 times the contrast of green": lambda x: _coupled(x, 0.06, 0.06),
    "red and blue 0.94 times": lambda x: _coupled(x, -0.06, -0.06),
    "red alone 1.06 times": lambda x: _coupled(x, 0.06, 0.0),
    "blue alone 1.06 times": lambda x: _coupled(x, 0.0, 0.06),
    "hues within a patch 0.7 times": lambda x: _times_hues(x, 0.7),
    "hues within a patch 1.3 times": lambda x: _times_hues(x, 1.3),
    "luma finer than 1 px 0.8 times": lambda x: _times_luma(x, 0.8, 0.0, 1.0),
    "luma of 1 to 4 px 1.3 times": lambda x: _times_luma(x, 1.3, 1.0, 4.0),
    "luma of 4 to 16 px 1.3 times": lambda x: _times_luma(x, 1.3, 4.0, 16.0),
    "blurred by 0.4 px": lambda x: _blur(x, 0.4),
    "0.7 times as bright": lambda x: 0.7 * x,
}
"""Name -> what it makes of clean packed patches (B, 4, h, w), 0..1. Lengths in packed pixels."""


class Network:
    """A trained network and the direction in which data pulls it."""

    def __init__(self, run: Path) -> None:
        self.config = load_settings(TrainConfig, run / CONFIG_FILE)
        self._net = RawDenoiser(self.config.network)
        optimizer = torch.optim.AdamW(self._net.parameters())
        state = load_checkpoint(run, self._net, optimizer)
        if state.step == 0:
            raise FsidError(f"{run}: holds no checkpoint")
        moments = [optimizer.state[p]["exp_avg_sq"].reshape(-1) for p in self._net.parameters()]
        self.scale = 1 / (torch.cat(moments).sqrt() + 1e-8)
        self._net.load_state_dict(state.average)

    def gradient(self, batch: Batch, alter: Alteration) -> Tensor:
        """(weights,) of the loss on the batch's patches, altered, with the same draw of noise."""
        k, sigma2 = batch.k[:, :, None, None], batch.sigma2[:, :, None, None]
        noise = (batch.noisy - batch.clean) / (k * batch.clean + sigma2).sqrt()
        clean = torch.from_numpy(alter(batch.clean.numpy()).astype(np.float32))
        noisy = clean + noise * (k * clean + sigma2).sqrt()
        self._net.zero_grad()
        noise_left(self._net(noisy, batch.k, batch.sigma2), clean, batch.k, batch.sigma2).backward()
        return torch.cat([p.grad.reshape(-1) for p in self._net.parameters() if p.grad is not None])

    def batches(self, data: Path, count: int) -> Iterator[Batch]:
        """`count` batches of a dataset, the same ones every time."""
        c = self.config
        patches = PatchConfig(c.patch_px, _BATCH, c.profiles, c.iso_min, c.iso_max)
        dataset = PatchDataset(data, patches, seed=0)
        return (dataset[step] for step in range(count))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path)
    parser.add_argument("photos", type=Path)
    parser.add_argument("data", type=Path, nargs="+")
    parser.add_argument("--batches", type=int, default=60, help=f"of {_BATCH} patches each (default 60)")
    given = parser.parse_args()
    try:
        network = Network(given.run)
        same = ALTERATIONS["as it is"]
        photos = [network.gradient(b, same) for b in network.batches(given.photos, 2 * given.batches)]
        towards = network.scale * torch.stack(photos[::2]).mean(0)
        whole = float(torch.stack(photos[1::2]).mean(0) @ towards)
        table = Table("data", "altered", "pull, %", "more than as it is", "its standard error")
        for data in given.data:
            plain = np.zeros(given.batches)
            for name, alter in ALTERATIONS.items():
                pulls = [network.gradient(b, alter) @ towards for b in network.batches(data, given.batches)]
                percent = 100 * np.array([float(p) for p in pulls]) / whole
                plain = percent if name == "as it is" else plain
                more, error = percent - plain, (percent - plain).std() / np.sqrt(given.batches)
                table.add_row(
                    data.name, name, f"{percent.mean():+.1f}", f"{more.mean():+.1f}", f"{error:.1f}"
                )
    except FsidError as problem:
        parser.error(str(problem))
    Console().print(table)


if __name__ == "__main__":
    main()
