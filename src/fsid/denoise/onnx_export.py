"""The network as one ONNX graph that needs nothing of this package: packed RAW in, packed clean RAW out.

    clean, averages_out = graph(noisy, k, sigma2, averages = 0, frozen = 0)

The stabilising transform and its inverse are inside the graph, and so is the choice of channel attention's
averages: with frozen = 0 they are taken over the input, as in training, and given out; with frozen = 1 those
that are given in are used. An image that fits into memory is one call. A large one takes the mean of the
averages of some patches first, then overlapping tiles with that mean: what `denoise_raw` does. `averages` and
`frozen` have defaults in the file, so that a caller without tiles need not feed them.
"""

from __future__ import annotations

import copy
import io
import json
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

import torch
from torch import Tensor, nn

from fsid.config import to_plain
from fsid.denoise.model import Denoiser
from fsid.denoise.nafnet import SpatialMean, spatial_means
from fsid.denoise.onnx_denoiser import CARD_KEY

OPSET = 18
_EXAMPLE_PX = 64
_MAX_PX = 1 << 15

DESCRIPTION = """FSID RAW denoiser: clean, averages_out = graph(noisy, k, sigma2, averages, frozen).
Before: x = (DN - black) / (white - black) in float32, values below 0 kept. The Bayer mosaic becomes 4 planes
R, Gr, Gb, B (Gr: the green in the rows of red): plane[i][j] = x[2i + row][2j + column], row and column of the
site in an RGGB tile. Mirror another pattern outwards by one row and/or column (index -1 = index 1) so that
its first pixel is R; cut that off again at the end. Pad the planes, mirroring, to multiples of `multiple`.
Inputs: noisy (1, 4, H, W). k, sigma2 (1, 4): the noise variance of a site is k x + sigma2, in units of x, as
in the DNG tag NoiseProfile. averages, frozen: leave them out, or see Tiles.
After: clean (1, 4, H, W) in units of x, not clipped. Unpack it; DN = black + x (white - black).
Tiles, for images that do not fit into memory: run some patches, `patch_px` wide and high in each plane, from
all over the image, take the mean of their averages_out, and give it as `averages`, with frozen = 1, to tiles
that start on multiples of `multiple` and overlap by `receptive_radius` rounded up to it; keep their inside.
The result is that of one large call."""


class _Half(nn.Module):
    """NAFNet in half precision between single-precision neighbours.

    The stabilising transform stays outside: k and sigma2 of a phone (1e-4, 1e-6) are below what half
    precision resolves.
    """

    def __init__(self, core: nn.Module) -> None:
        super().__init__()
        self.core = core.half()

    def forward(self, image: Tensor) -> Tensor:
        return self.core(image.half()).float()


class _Graph(nn.Module):
    """The network with its averages as input and output; half: NAFNet in float16."""

    def __init__(self, denoiser: Denoiser, half: bool) -> None:
        super().__init__()
        self.net = copy.deepcopy(denoiser.net).cpu()
        if half:
            self.net.net = _Half(self.net.net)  # type: ignore[assignment]
        self.widths = denoiser.attention_widths

    def forward(
        self, noisy: Tensor, k: Tensor, sigma2: Tensor, averages: Tensor, frozen: Tensor
    ) -> tuple[Tensor, Tensor]:
        means = spatial_means(self.net)
        given = dict(zip(means, averages.split(list(self.widths)), strict=True))
        used: dict[SpatialMean, Tensor] = {}

        def choose(mean: SpatialMean, _: Any, own: Tensor) -> Tensor:
            used[mean] = frozen * given[mean].reshape(1, -1, 1, 1) + (1 - frozen) * own.float()
            return used[mean].to(own.dtype)

        hooks = [mean.register_forward_hook(choose) for mean in means]
        clean = self.net(noisy, k, sigma2)
        for hook in hooks:
            hook.remove()
        return clean, torch.cat([used[mean].flatten() for mean in means])


def onnx_model(denoiser: Denoiser, *, half: bool = False) -> Any:
    """The network as `onnx.ModelProto`, any height and width, metadata included; half: float16 inside."""
    import onnx
    import onnxscript  # noqa: F401  the exporter needs it, and says so in many lines where it is missing

    graph = _Graph(denoiser, half).eval()
    example = (
        torch.rand(1, 4, _EXAMPLE_PX, _EXAMPLE_PX),
        torch.full((1, 4), 1e-3),
        torch.full((1, 4), 1e-4),
        torch.zeros(sum(denoiser.attention_widths)),
        torch.zeros(()),
    )
    names = ["noisy", "k", "sigma2", "averages", "frozen"]
    sides = {
        2: torch.export.Dim("height", min=2, max=_MAX_PX),
        3: torch.export.Dim("width", min=2, max=_MAX_PX),
    }
    with _silent():
        program = torch.onnx.export(
            graph,
            example,
            dynamo=True,
            opset_version=OPSET,
            input_names=names,
            output_names=["clean", "averages_out"],
            dynamic_shapes={name: sides if name == "noisy" else None for name in names},
        )
    assert program is not None
    model = program.model_proto
    for name, default in zip(names[3:], example[3:], strict=True):
        model.graph.initializer.append(onnx.numpy_helper.from_array(default.numpy(), name))
    return _described(model, denoiser)


def onnx_bytes(denoiser: Denoiser) -> bytes:
    """`onnx_model`, serialised."""
    return onnx_model(denoiser).SerializeToString()


def _described(model: Any, denoiser: Denoiser) -> Any:
    import onnx

    for part in (*model.graph.node, *model.graph.value_info, *model.graph.input, *model.graph.output):
        part.ClearField("metadata_props")  # Python stack traces, with paths of this machine
        part.ClearField("doc_string")
    model.graph.ClearField("metadata_props")
    model.producer_name, model.doc_string = "fsid", DESCRIPTION
    notes = {
        CARD_KEY: json.dumps(to_plain(denoiser.card)),
        "multiple": str(denoiser.multiple),
        "receptive_radius": str(denoiser.receptive_radius),
        "patch_px": str(denoiser.card.patch_px),
        "description": DESCRIPTION,
    }
    onnx.helper.set_model_props(model, notes)
    return model


@contextmanager
def _silent() -> Iterator[None]:
    """The exporter reports its stages on stdout and in warnings."""
    log = logging.getLogger("torch.onnx")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings(), redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            yield
    finally:
        log.setLevel(level)
