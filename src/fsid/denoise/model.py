"""A trained network as one file: weights in safetensors, the card that describes them as JSON in its header.

The card says everything that is needed to rebuild and to judge the network: its size, the patch size it was
trained with, the training settings. One file cannot come apart, and safetensors holds numbers only: nothing
that a user hands over is ever unpickled. A readable copy of the card is written beside the file.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from fsid.config import from_plain, to_plain
from fsid.denoise.nafnet import NAFBlock, frozen_pooling, pooling
from fsid.denoise.raw_denoiser import MAX_PATCH_PX, NetworkConfig, RawDenoiser
from fsid.errors import FsidError
from fsid.files import write_atomically
from fsid.sensor import NoiseLevel

MODEL_FILE = "model.safetensors"  # inside a run folder
WEIGHTS = Path(str(files("fsid.denoise"))) / "weights"  # what ships: NAME.safetensors and its card, NAME.json
DEFAULT_MODEL = "nafnet-small"
_CARD = "fsid_card"
_STORED = (torch.float16, torch.bfloat16, torch.float32, torch.float64)


@dataclass(frozen=True)
class ModelCard:
    """What a network is.

    network: its size. patch_px: side of its training patches in packed pixels. training: one line on what it
    was trained on. details: settings and results in plain JSON values, for people; nothing is read back.
    lowest: x of DN 0 of the cameras that it was trained on, below which it has seen no noise; of several, the
    highest. most_noise: variance at mid-grey of the strongest noise that it was trained on, 0 where unknown.
    """

    network: NetworkConfig
    patch_px: int
    training: str = ""
    details: dict[str, Any] = field(default_factory=dict)
    lowest: float = -64 / 959  # of all built-in profiles
    most_noise: float = 0.0

    def __post_init__(self) -> None:
        if not 1 <= self.patch_px <= MAX_PATCH_PX:
            raise FsidError(f"patch_px {self.patch_px}: must be 1 to {MAX_PATCH_PX}")
        if not -math.inf < self.lowest <= 0:
            raise FsidError(f"lowest {self.lowest}: must be finite and at most 0")


@dataclass(frozen=True)
class Denoiser:
    """A network ready for use, in evaluation mode on `device`; the tiles of `denoise_raw` run through it."""

    net: RawDenoiser = field(repr=False)
    card: ModelCard
    device: torch.device

    @property
    def multiple(self) -> int:
        """What height and width of an input must be multiples of, in packed pixels."""
        return self.net.net.multiple

    @property
    def receptive_radius(self) -> int:
        """How far an output reaches once the averages are given, in packed pixels."""
        return self.net.net.receptive_radius

    @property
    def attention_widths(self) -> tuple[int, ...]:
        """How many averages each block takes, in the order of `spatial_means`."""
        return tuple(len(block.norm1.weight) for block in self.net.modules() if isinstance(block, NAFBlock))

    @torch.no_grad()
    def averages(self, patch: np.ndarray, level: NoiseLevel) -> np.ndarray:
        """The averages that channel attention takes over `patch` (4, h, w), one after the other: (n,)."""
        with torch.autocast(self.device.type, enabled=False):
            seen = pooling(self.net, lambda: self.net(*self._inputs(patch, level)))
        return torch.cat([mean.flatten() for mean in seen] or [torch.zeros(0)]).cpu().numpy()

    @torch.no_grad()
    def run(self, tile: np.ndarray, level: NoiseLevel, averages: np.ndarray) -> np.ndarray:
        """The clean estimate (4, h, w) of `tile` with channel attention held at `averages` (n,)."""
        parts = torch.from_numpy(averages).to(self.device).split(list(self.attention_widths))
        held = frozen_pooling(self.net, [part[None, :, None, None] for part in parts])
        with held, torch.autocast(self.device.type, enabled=False):
            return self.net(*self._inputs(tile, level))[0].cpu().numpy()

    def _inputs(self, packed: np.ndarray, level: NoiseLevel) -> tuple[Tensor, Tensor, Tensor]:
        image = torch.from_numpy(packed)[None].to(self.device)
        k, sigma2 = (
            torch.tensor([v], dtype=torch.float32, device=self.device) for v in (level.k, level.sigma2)
        )
        return image, k, sigma2


def save_model(
    path: str | Path,
    weights: Mapping[str, Tensor],
    card: ModelCard,
    circumstances: Mapping[str, Any] | None = None,
) -> None:
    """Write `path` (.safetensors) and the card beside it (.json), each atomically.

    circumstances: for the readable copy alone, for example when and on what the network was trained.
    """
    path, plain = Path(path), to_plain(card)
    write_tensors(path, weights, {_CARD: json.dumps(plain, indent=1)})
    readable = json.dumps(plain | dict(circumstances or {}), indent=1)
    write_atomically(path.with_suffix(".json"), readable.encode())


def model_path(run_or_file: str | Path | None) -> Path:
    """The file of a network: of a run folder, a shipped one by its name, a file; None is `DEFAULT_MODEL`."""
    name = str(run_or_file or DEFAULT_MODEL)
    shipped = WEIGHTS / f"{name}.safetensors"
    is_name = os.path.basename(name) == name  # of a whole path pathlib would take the file beside a run
    if is_name and os.path.isfile(shipped):  # unlike Path.is_file, False for a name that is too long, too
        return shipped
    if run_or_file is None:
        raise FsidError("no network ships with this version of FSID; give one with --model RUN or FILE")
    path = Path(run_or_file)
    return path / MODEL_FILE if os.path.isdir(path) else path


def load_denoiser(run_or_file: str | Path | None = None, device: str | torch.device = "cpu") -> Denoiser:
    """Load a run folder's network, a .safetensors file, or a shipped network by name; None: the default one.

    Weights may be stored in half precision; they are used in single. Raises FsidError where the file is
    missing, broken, not a network of FSID, or does not fit its own card, and where `device` is not there.
    """
    target = _usable(device)
    path = model_path(run_or_file)
    weights, header = read_tensors(
        path, "a model: give a run folder of `fsid train` or its model.safetensors"
    )
    if _CARD not in header:
        raise FsidError(f"{path}: has no FSID model card; give a model that `fsid train` wrote")
    card = parse_card(header[_CARD], str(path))
    with torch.device("meta"):  # draws nothing, and a card that lies may ask for any amount of memory
        net = RawDenoiser(card.network)
    check_weights(net, weights, path)
    net.load_state_dict({name: tensor.float() for name, tensor in weights.items()}, assign=True)
    return Denoiser(net.to(target).eval().requires_grad_(False), card, target)


def _usable(device: str | torch.device) -> torch.device:
    """A device that numbers can be sent to and come back from; FsidError for any other."""
    try:
        target = torch.device(device)
        torch.zeros(1, device=target).cpu()
    except (RuntimeError, AssertionError) as error:  # the latter where PyTorch was built without it
        reason = str(error).partition("\n")[0].rstrip(".")
        raise FsidError(f"device {device}: PyTorch cannot use it ({reason}); cpu is always there") from None
    return target


def parse_card(text: str, source: str) -> ModelCard:
    """The card in a file's header; FsidError, naming `source`, where it is none."""
    try:
        plain = json.loads(text)
    except (ValueError, RecursionError):
        plain = None
    if not isinstance(plain, dict):
        raise FsidError(f"{source}: its model card is not a JSON object; copy the model again")
    return from_plain(ModelCard, plain, source=source)


def check_weights(net: torch.nn.Module, weights: Mapping[str, Tensor], path: Path) -> None:
    """FsidError unless `weights` are exactly the finite tensors that `net` holds."""
    expected = net.state_dict()
    for name in sorted(expected.keys() ^ weights.keys()):
        state = "lacks" if name in expected else "has an unknown"
        raise FsidError(
            f"{path}: {state} tensor {name}; it does not fit the network that its settings describe"
        )
    for name, tensor in weights.items():
        if tensor.shape != expected[name].shape:
            raise FsidError(
                f"{path}: tensor {name} is {tuple(tensor.shape)}, expected {tuple(expected[name].shape)}"
            )
        if tensor.dtype not in _STORED:
            raise FsidError(f"{path}: tensor {name} holds {tensor.dtype}; expected numbers of 16 to 64 bits")
        if not torch.isfinite(tensor.float()).all():
            raise FsidError(f"{path}: tensor {name} holds NaN or infinity; train again")


def write_tensors(path: Path, tensors: Mapping[str, Tensor], header: Mapping[str, str]) -> None:
    """Write a safetensors file atomically, tensors in row-major order."""
    plain = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    write_atomically(path, save(plain, dict(header)))


def read_tensors(path: Path, expected: str) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Tensors and header of a safetensors file; FsidError says that `path` is not `expected`."""
    if not os.path.isfile(path):
        raise FsidError(f"{path}: no such file; expected {expected}")
    if any("\ud800" <= letter <= "\udfff" for letter in str(path)):
        raise FsidError(f"{path}: safetensors opens no file whose path is not UTF-8; rename it")
    try:
        with safe_open(path, framework="pt") as file:
            return {name: file.get_tensor(name) for name in file.keys()}, file.metadata() or {}  # noqa: SIM118
    except (SafetensorError, OSError, MemoryError) as error:
        raise FsidError(f"{path}: is not {expected} ({error})") from None
