"""An exported network with 8-bit convolutions.

Weights and activations of all convolutions but the first and the last, which see the image itself, with one
scale per output channel; ranges of activations from noisy photographs. As quantise-dequantise pairs, which
phone runtimes fuse. Weights use 7 of their 8 bits: processors without dot products of 8 bits (x86 before
AVX512-VNNI) add two products in 16 bits, and cut off what does not fit.
"""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fsid.denoise.onnx_denoiser import inputs
from fsid.denoise.probes import CALIBRATED, CALIBRATED_ISOS, probes
from fsid.sensor import pack

_CALIBRATION_TILE = 128
_WARNINGS, _ERRORS = 2, 3
"""Severities of onnxruntime's own log; the first is its default."""


def eight_bit(model: Any) -> Any:
    """An 8-bit copy of an `onnx.ModelProto` of `onnx_model`."""
    import onnx
    from onnxruntime import quantization, set_default_logger_severity

    convolutions = [node.name for node in model.graph.node if node.op_type == "Conv"]
    log = logging.getLogger()
    level = log.level
    log.setLevel(logging.ERROR)  # it recommends a preprocessing step that changes nothing here
    set_default_logger_severity(_ERRORS)  # and constants where averages must stay inputs
    try:
        with tempfile.TemporaryDirectory() as folder:
            source, target = Path(folder) / "float.onnx", Path(folder) / "int8.onnx"
            onnx.save(model, source)
            quantization.quantize_static(
                str(source),
                str(target),
                _reader(quantization.CalibrationDataReader),
                quant_format=quantization.QuantFormat.QDQ,
                op_types_to_quantize=["Conv"],
                nodes_to_exclude=[convolutions[0], convolutions[-1]],
                per_channel=True,
                activation_type=quantization.QuantType.QUInt8,
                weight_type=quantization.QuantType.QInt8,
                reduce_range=True,
            )
            small = onnx.load(target)
    finally:
        log.setLevel(level)
        set_default_logger_severity(_WARNINGS)
    onnx.helper.set_model_props(small, {p.key: p.value for p in model.metadata_props})
    return small


def _reader(base: type) -> Any:
    """onnxruntime asks its reader for one dictionary of inputs after the other, then for None."""

    class Reader(base):
        def __init__(self) -> None:
            self._feeds = _feeds()

        def get_next(self) -> dict[str, np.ndarray] | None:
            return next(self._feeds, None)

    return Reader()


def _feeds() -> Iterator[dict[str, np.ndarray]]:
    for probe in probes(CALIBRATED, CALIBRATED_ISOS):
        raw = probe.noisy
        assert raw.noise is not None
        packed = pack(raw.mosaic, raw.cfa)[:, :_CALIBRATION_TILE, :_CALIBRATION_TILE]
        yield inputs(np.ascontiguousarray(packed), raw.noise)
