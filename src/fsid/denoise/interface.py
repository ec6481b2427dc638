"""The denoiser in a few lines of Python: load a network once, denoise RAW images with it."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, get_args

import torch

from fsid.denoise.denoise import Network, check_network, denoise_raw
from fsid.denoise.files import noise_of
from fsid.denoise.model import load_denoiser, model_path
from fsid.denoise.onnx_denoiser import load_onnx, onnx_denoiser
from fsid.errors import FsidError
from fsid.sensor import CameraProfile, NoiseLevel, Raw, clean_levels
from fsid.sensor.profiles import check_bayer
from fsid.sensor.raw import check_raw

Backend = Literal["torch", "onnx"]


def load_model(model: str | Path | None = None, backend: Backend | None = None) -> Network:
    """A network that is ready to denoise.

    model: run folder, .safetensors or .onnx file, or the name of a shipped network; None: the default one.
    backend: what runs it, None: onnxruntime for an .onnx file, else PyTorch (on a GPU where there is one).
    PyTorch weights are converted for backend "onnx", which takes some seconds. FsidError: no such network,
    a broken file, an .onnx file for PyTorch, or another backend.
    """
    if backend not in (None, *get_args(Backend)):
        raise FsidError(f"backend {backend!r}: is not one of {', '.join(get_args(Backend))}")
    path = model_path(model)
    if path.suffix.lower() == ".onnx":
        if backend == "torch":
            raise FsidError(f"{path}: is run by onnxruntime, not PyTorch; leave out the backend")
        return load_onnx(path)
    denoiser = load_denoiser(path, "cuda" if torch.cuda.is_available() and backend != "onnx" else "cpu")
    if backend != "onnx":
        return denoiser
    from fsid.denoise.onnx_export import onnx_bytes

    return onnx_denoiser(onnx_bytes(denoiser), str(path))


def denoise(
    raw: Raw,
    profile: str | Path | CameraProfile | None = None,
    *,
    iso: float | None = None,
    model: Network | str | Path | None = None,
    strength: float = 1.0,
    ensemble: int = 1,
) -> Raw:
    """The clean estimate of `raw`, with levels fine enough to store it, as `fsid denoise` makes it.

    profile: a camera's noise profile, by name, file or as it was loaded, taken at `iso` or at the ISO of
    `raw`; None takes the noise level that `raw` knows, and else estimates it from the image. model: see
    `load_model`; load it once to denoise many images. strength: 0..1 is the share of the noise that is
    removed, above 1 smooths more. ensemble: 2, 4 or 8 average over so many mirrored and transposed copies,
    which takes as many times the time and leaves less error. `denoise_raw` takes a noise level, tiles and a
    callback. Raises FsidError.
    """
    check_raw(raw)
    if isinstance(profile, NoiseLevel):
        raise FsidError("a NoiseLevel is no profile: it belongs to the image, replace(raw, noise=level)")
    network = load_model(model) if model is None or isinstance(model, str | Path) else model
    check_network(network)
    if isinstance(profile, CameraProfile):
        check_bayer(profile, f"profile {profile.name}")
        if iso is None and not raw.iso > 0:
            raise FsidError(f"{raw.camera}: its ISO is unknown, give iso")
        level = profile.level(raw.iso if iso is None else iso)
    else:
        level = noise_of(raw, None if profile is None else str(profile), iso, Path(raw.camera)).level
    return clean_levels(denoise_raw(raw, network, level, strength=strength, ensemble=ensemble))
