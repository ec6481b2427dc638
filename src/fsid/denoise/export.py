"""A trained network as one file for others: .onnx for any runtime, .safetensors to ship with this package.

Each is checked before it is written: an .onnx file against PyTorch, a smaller precision for what it costs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import torch

from fsid.denoise.denoise import Network, denoise_raw
from fsid.denoise.model import Denoiser, load_denoiser, model_path, save_model
from fsid.denoise.onnx_denoiser import onnx_denoiser
from fsid.denoise.onnx_export import onnx_model
from fsid.denoise.onnx_int8 import eight_bit
from fsid.denoise.probes import Probe, mean_psnr, probes
from fsid.denoise.sessions import read_sessions
from fsid.errors import FsidError
from fsid.files import check_output, same_files, write_atomically
from fsid.sensor import NoiseLevel
from fsid.yaml_json import read_json

Precision = Literal["float32", "float16", "int8"]
TOLERANCE = 1e-4  # between onnxruntime and PyTorch, of the normalised clean image
HALF_LIMIT_DB = 0.01  # weights are shipped in half precision where that costs less


@dataclass(frozen=True)
class Export:
    """What was written.

    psnr: of the network on the probes, dB; loss_db: what the file's precision costs of it. difference: the
    largest one of an .onnx file to PyTorch on the probes, normalised units; 0 for .safetensors.
    """

    file: Path
    precision: Precision
    psnr: float
    loss_db: float
    difference: float


def export(run: str | Path | None, file: str | Path, precision: Precision | None = None) -> Export:
    """Write the network of `run` (see `load_model`) to `file`, .onnx or .safetensors.

    precision: None is float32 for .onnx, and for .safetensors float16 where that costs less than
    `HALF_LIMIT_DB`. FsidError: no such network, another suffix or precision, the network itself as `file`, a
    result that does not agree.
    """
    path, file = model_path(run), Path(file)
    suffix = file.suffix.lower()
    if suffix not in (".onnx", ".safetensors"):
        raise FsidError(f"{file}: a network is exported as .onnx or .safetensors")
    if precision not in (None, *get_args(Precision)):
        raise FsidError(f"precision {precision}: choose {', '.join(get_args(Precision))}")
    if suffix == ".safetensors" and precision == "int8":
        raise FsidError("int8: is for .onnx; .safetensors holds float32 or float16")
    if same_files([file], [path]):
        raise FsidError(f"{file}: is the network itself, which would be overwritten; give another name")
    check_output(file)
    denoiser = load_denoiser(path)
    if suffix == ".onnx" and not denoiser.attention_widths:
        raise FsidError(f"{path}: has no blocks, without which there is no .onnx; export it as .safetensors")
    measured = probes()
    if suffix == ".onnx":
        return _onnx(denoiser, file, precision or "float32", measured)
    return _safetensors(denoiser, path, file, precision, measured)


def _onnx(denoiser: Denoiser, file: Path, precision: Precision, measured: list[Probe]) -> Export:
    model = onnx_model(denoiser)
    graph = model.SerializeToString()
    network = onnx_denoiser(graph, str(file))
    difference = _difference(network, denoiser, [*measured, _noise_free(measured[0])])
    if not difference <= TOLERANCE:
        raise FsidError(f"{file}: onnxruntime differs from PyTorch by {difference:.1e}; nothing was written")
    if precision != "float32":
        model = onnx_model(denoiser, half=True) if precision == "float16" else eight_bit(model)
        graph = model.SerializeToString()
        network = onnx_denoiser(graph, str(file))
        difference = _difference(network, denoiser, measured)
    psnr = mean_psnr(denoiser, measured)
    loss = psnr - mean_psnr(network, measured)
    write_atomically(file, graph)
    return Export(file, precision, psnr, loss, difference)


def _difference(network: Network, denoiser: Denoiser, measured: list[Probe]) -> float:
    """The largest one between two networks on the probes, normalised units."""
    return max(
        float(np.abs(denoise_raw(p.noisy, network).mosaic - denoise_raw(p.noisy, denoiser).mosaic).max())
        for p in measured
    )


def _noise_free(probe: Probe) -> Probe:
    """As a DNG may state it, k = sigma2 = 0, where what divides by the noise may find none."""
    return replace(probe, noisy=replace(probe.noisy, noise=NoiseLevel((0.0,) * 4, (0.0,) * 4)))


def _safetensors(
    denoiser: Denoiser, source: Path, file: Path, precision: Precision | None, measured: list[Probe]
) -> Export:
    weights = denoiser.net.state_dict()
    halved = {name: tensor.half() for name, tensor in weights.items()}
    net = type(denoiser.net)(denoiser.card.network).eval().requires_grad_(False)
    net.load_state_dict(halved)
    half = replace(denoiser, net=net, device=torch.device("cpu"))
    psnr = mean_psnr(denoiser, measured)
    loss = psnr - mean_psnr(half, measured)
    if precision is None:
        precision = "float16" if loss < HALF_LIMIT_DB else "float32"
    small = precision == "float16"
    notes = {"sessions": read_sessions(source.parent) or _sessions_of(source), "precision": precision}
    save_model(file, halved if small else weights, denoiser.card, notes)
    return Export(file, precision, psnr, loss if small else 0.0, 0.0)


def _sessions_of(model: Path) -> list[object]:
    """The sessions in the card beside a network that was exported before."""
    try:
        return list(read_json(model.with_suffix(".json"))["sessions"])
    except (FsidError, KeyError, TypeError):
        return []
