"""An exported network under onnxruntime: the same two calls as the PyTorch one, without PyTorch in them.

    averages(patch) = graph(patch)["averages_out"]
    run(tile, averages) = graph(tile, averages, frozen = 1)["clean"]

See `onnx_export` for the graph. What the tiles need to know (stride, reach, patch size) follows from the card
in its metadata.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fsid.denoise.model import ModelCard, parse_card
from fsid.denoise.nafnet import receptive_radius
from fsid.errors import FsidError
from fsid.files import read_whole
from fsid.sensor import NoiseLevel

CARD_KEY = "fsid_card"
INPUTS = ("noisy", "k", "sigma2", "averages", "frozen")  # in this order
OUTPUTS = ("clean", "averages_out")
_MOST_BYTES = 2 << 30  # of an ONNX file, by its format


@dataclass(frozen=True)
class OnnxDenoiser:
    """A network ready for use on the CPU; see `Network`."""

    session: Any
    card: ModelCard
    source: str

    @property
    def multiple(self) -> int:
        """See `Denoiser`; it follows from the card, as the next one does."""
        return 2 ** len(self.card.network.encoder_blocks)

    @property
    def receptive_radius(self) -> int:
        """See `Denoiser`."""
        network = self.card.network
        return receptive_radius(network.encoder_blocks, network.middle_blocks, network.decoder_blocks)

    def averages(self, patch: np.ndarray, level: NoiseLevel) -> np.ndarray:
        """The averages that channel attention takes over `patch` (4, h, w): (n,)."""
        return self._run("averages_out", inputs(patch, level))

    def run(self, tile: np.ndarray, level: NoiseLevel, averages: np.ndarray) -> np.ndarray:
        """The clean estimate (4, h, w) of `tile` with channel attention held at `averages` (n,)."""
        frozen = {"averages": averages.astype(np.float32), "frozen": np.ones((), np.float32)}
        clean = self._run("clean", inputs(tile, level) | frozen)
        if clean.shape != (1, *tile.shape):
            raise FsidError(f"{self.source}: makes {clean.shape} of {(1, *tile.shape)}; export it again")
        return clean[0]

    def _run(self, output: str, feed: dict[str, np.ndarray]) -> np.ndarray:
        try:
            return self.session.run([output], feed)[0]
        except Exception as error:  # onnxruntime has a class of its own per reason, and no common one
            raise FsidError(f"{self.source}: onnxruntime cannot run it ({_line(error)})") from None


def load_onnx(file: Path) -> OnnxDenoiser:
    """A file of `fsid export`; FsidError where it is missing or something else."""
    return onnx_denoiser(read_whole(file, _MOST_BYTES), str(file))


def onnx_denoiser(graph: bytes, source: str, *, threads: int = 0) -> OnnxDenoiser:
    """The network of a serialised graph; `source` names it in errors. threads: 0 for all cores."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 4  # errors are raised, too; it would print names as they are in the file
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        session = onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # see `OnnxDenoiser._run`
        raise FsidError(f"{source}: is not a network that onnxruntime can read ({_line(error)})") from None
    text = session.get_modelmeta().custom_metadata_map.get(CARD_KEY)
    given = {value.name for value in (*session.get_inputs(), *session.get_overridable_initializers())}
    made = {value.name for value in session.get_outputs()}
    if text is None or given != {*INPUTS} or made != {*OUTPUTS}:
        raise FsidError(f"{source}: is not a file of `fsid export`")
    return OnnxDenoiser(session, parse_card(text, source), source)


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


def inputs(packed: np.ndarray, level: NoiseLevel) -> dict[str, np.ndarray]:
    """What the graph needs at least: `packed` (4, h, w) and its noise level."""
    k, sigma2 = (np.array([values], np.float32) for values in (level.k, level.sigma2))
    return {"noisy": packed[None], "k": k, "sigma2": sigma2}
