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
from fsid.denoise.onnx_denoiser import CARD_KEY, INPUTS, OUTPUTS

OPSET = 18
_EXAMPLE_PX = 64
_MAX_PX = 1 << 15

DESCRIPTION = """FSID RAW denoiser: clean, averages_out = graph(noisy, k, sigma2, averages, frozen).
Before: x = (DN - black) / (white - black) in float32, values below 0 kept. Mirror the Bayer mosaic outwards
(index -1 is index 1): by a row at the top and a column at the left where that makes its first pixel R, and at
the bottom and right to multiples of 2 `multiple`. Its planes R, Gr, Gb, B are x[0::2, 0::2], x[0::2, 1::2],
x[1::2, 0::2], x[1::2, 1::2].
Inputs: noisy (1, 4, H, W), the planes. k, sigma2 (1, 4): the noise variance of a site is k x + sigma2, in
units of x, as in the DNG tag NoiseProfile (where it has three pairs, both greens take the second). averages,
frozen: leave them out, or see Large images.
After: clean (1, 4, H, W) in units of x. Unpack it in the same way and cut off what was mirrored. Set what is
above the limit of its plane to that limit: of saturated light, which has no noise, the graph makes some
percent more. The limit is the brightest x of the plane, where that is above 0.5 and n - m > 5 sqrt(n + m), n
pixels having its DN and m the one before; else the larger of 1 and the brightest x of the whole mosaic. What
is below 0 stays. DN = black + x (white - black).
Large images, where H or W is above 2 `patch_px`: first run patches, `patch_px` high and wide in a plane, in
max(1, round(4 sqrt(H / W))) rows and max(1, round(4 sqrt(W / H))) columns. Number i of n along a side starts
at round((side - patch_px) (i + 1/2) / n), halves to the even number, or at 0 where the side is shorter. Give
the mean of their averages_out as `averages`, with frozen = 1, to the whole image, or to tiles that start on
multiples of `multiple` and see `receptive_radius`, rounded up to such a one, beyond what is kept of them.
Tiles make the same as the whole image with the same averages: what `fsid denoise` makes, but where noise is
cut off at a DN 0 whose x is above 0.9 `lowest` of the card: that it draws anew after a first pass, and
repeats."""


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
            input_names=INPUTS,
            output_names=OUTPUTS,
            dynamic_shapes={name: sides if name == "noisy" else None for name in INPUTS},
        )
    assert program is not None
    model = program.model_proto
    for name, default in zip(INPUTS[3:], example[3:], strict=True):
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
