"""A trained network as one file: weights in safetensors, the card that describes them as JSON in its header.

The card says everything that is needed to rebuild and to judge the network: its size, the patch size it was
trained with, the training settings. One file cannot come apart, and safetensors holds numbers only: nothing
that a user hands over is ever unpickled. A readable copy of the card is written beside the file.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from fsid.config import from_plain, to_plain
from fsid.denoise.raw_denoiser import NetworkConfig, RawDenoiser
from fsid.errors import FsidError
from fsid.files import write_atomically

MODEL_FILE = "model.safetensors"  # inside a run folder
_CARD = "fsid_card"


@dataclass(frozen=True)
class ModelCard:
    """What a network is.

    network: its size. patch_px: side of its training patches in packed pixels. training: one line on what it
    was trained on. details: settings and results in plain JSON values, for people; nothing is read back.
    """

    network: NetworkConfig
    patch_px: int
    training: str = ""
    details: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Denoiser:
    """A network ready for use, in evaluation mode on `device`."""

    net: RawDenoiser
    card: ModelCard
    device: torch.device


def save_model(
    path: Path, weights: Mapping[str, Tensor], card: ModelCard, circumstances: Mapping[str, Any] | None = None
) -> None:
    """Write `path` (.safetensors) and the card beside it (.json), each atomically.

    circumstances: for the readable copy alone, for example when and on what the network was trained.
    """
    plain = to_plain(card)
    write_tensors(path, weights, {_CARD: json.dumps(plain, indent=1)})
    readable = json.dumps(plain | dict(circumstances or {}), indent=1)
    write_atomically(path.with_suffix(".json"), readable.encode())


def load_model(run_or_file: str | Path, device: str | torch.device = "cpu") -> Denoiser:
    """Load a run folder's network or a .safetensors file.

    Raises FsidError where it is missing, broken, not a network of FSID, or does not fit its own card.
    """
    path = Path(run_or_file)
    if path.is_dir():
        path = path / MODEL_FILE
    weights, header = read_tensors(
        path, "a model: give a run folder of `fsid train` or its model.safetensors"
    )
    if _CARD not in header:
        raise FsidError(f"{path}: has no FSID model card; give a model that `fsid train` wrote")
    try:
        plain = json.loads(header[_CARD])
    except ValueError:
        raise FsidError(f"{path}: its model card is not valid JSON; copy the model again") from None
    card = from_plain(ModelCard, plain, source=str(path))
    net = RawDenoiser(card.network)
    check_weights(net, weights, path)
    net.load_state_dict(weights)
    target = torch.device(device)
    return Denoiser(net.to(target).eval().requires_grad_(False), card, target)


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
        if not torch.isfinite(tensor).all():
            raise FsidError(f"{path}: tensor {name} holds NaN or infinity; train again")


def write_tensors(path: Path, tensors: Mapping[str, Tensor], header: Mapping[str, str]) -> None:
    """Write a safetensors file atomically, tensors in row-major order."""
    plain = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    write_atomically(path, save(plain, dict(header)))


def read_tensors(path: Path, expected: str) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Tensors and header of a safetensors file; FsidError says that `path` is not `expected`."""
    if not path.is_file():
        raise FsidError(f"{path}: no such file; expected {expected}")
    try:
        with safe_open(path, framework="pt") as file:
            return {name: file.get_tensor(name) for name in file.keys()}, file.metadata() or {}  # noqa: SIM118
    except (SafetensorError, OSError) as error:
        raise FsidError(f"{path}: is not {expected} ({error})") from None
