"""An exported network under onnxruntime: the same two calls as the PyTorch one, without PyTorch in them.

    averages(patch) = graph(patch)["averages_out"]
    run(tile, averages) = graph(tile, averages, frozen = 1)["clean"]

See `onnx_export` for the graph. What the tiles need to know (stride, reach, patch size) is in its metadata.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fsid.config import from_plain
from fsid.denoise.model import ModelCard
from fsid.errors import FsidError
from fsid.sensor import NoiseLevel

CARD_KEY, MULTIPLE_KEY, RADIUS_KEY = "fsid_card", "multiple", "receptive_radius"


@dataclass(frozen=True)
class OnnxDenoiser:
    """A network ready for use on the CPU; see `Network`."""

    session: Any
    card: ModelCard
    multiple: int
    receptive_radius: int

    def averages(self, patch: np.ndarray, level: NoiseLevel) -> np.ndarray:
        """The averages that channel attention takes over `patch` (4, h, w): (n,)."""
        return self.session.run(["averages_out"], inputs(patch, level))[0]

    def run(self, tile: np.ndarray, level: NoiseLevel, averages: np.ndarray) -> np.ndarray:
        """The clean estimate (4, h, w) of `tile` with channel attention held at `averages` (n,)."""
        frozen = {"averages": averages.astype(np.float32), "frozen": np.ones((), np.float32)}
        return self.session.run(["clean"], inputs(tile, level) | frozen)[0][0]


def load_onnx(file: Path) -> OnnxDenoiser:
    """A file of `fsid export`; FsidError where it is missing or something else."""
    try:
        return onnx_denoiser(file.read_bytes(), str(file))
    except OSError as error:
        raise FsidError(f"{file}: cannot be read ({error.strerror})") from None


def onnx_denoiser(graph: bytes, source: str, *, threads: int = 0) -> OnnxDenoiser:
    """The network of a serialised graph; `source` names it in errors. threads: 0 for all cores."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 3  # it warns that inputs with defaults are not constants
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        session = onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime has an exception class of its own per reason, and no common one
        reason = " ".join(str(error).split())
        raise FsidError(f"{source}: is not a network that onnxruntime can read ({reason})") from None
    notes = session.get_modelmeta().custom_metadata_map
    try:
        card = from_plain(ModelCard, json.loads(notes[CARD_KEY]), source=source)
        return OnnxDenoiser(session, card, int(notes[MULTIPLE_KEY]), int(notes[RADIUS_KEY]))
    except (KeyError, ValueError):
        raise FsidError(f"{source}: is not a file of `fsid export`") from None


def inputs(packed: np.ndarray, level: NoiseLevel) -> dict[str, np.ndarray]:
    """What the graph needs at least: `packed` (4, h, w) and its noise level."""
    k, sigma2 = (np.array([values], np.float32) for values in (level.k, level.sigma2))
    return {"noisy": packed[None], "k": k, "sigma2": sigma2}
