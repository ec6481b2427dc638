"""NAFNet: a U-Net without activation functions.

    block:  u = x + beta  * conv3( sca(g) * g ),   g = gate(conv2(conv1(norm1(x)))),   gate(a, b) = a * b
            y = u + gamma * conv5( gate(conv4(norm2(u))) ),         sca(g) = W mean_{h,w}(g) + c
    network: out = in + ending(decoder(middle(encoder(intro(in)))))

Chen et al., "Simple Baselines for Image Restoration", ECCV 2022, section 3 and figure 3; the names of modules
and parameters are those of the authors' reference implementation, so that its weight files load. beta and
gamma start at zero: every block starts as the identity.

`sca` is the only operation with an unbounded receptive field. `frozen_pooling` replaces its spatial mean by a
constant; what remains is a convolutional network whose reach is `receptive_radius`, which makes exact tiling
possible. Tensors are (B, C, H, W) in channels-last memory: a depthwise convolution is some ten times faster
there on a CPU, and the layer norm over channels becomes the fused norm over the last axis.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import torch
from torch import Tensor, nn
from torch.nn import functional


class LayerNorm2d(nn.Module):
    """Normalise over the channels of each pixel."""

    def __init__(self, channels: int, eps: float = 1e-6) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.ones(channels))
        self.bias = nn.Parameter(torch.zeros(channels))
        self.eps = eps

    def forward(self, x: Tensor) -> Tensor:
        last = functional.layer_norm(
            x.permute(0, 2, 3, 1), self.weight.shape, self.weight, self.bias, self.eps
        )
        return last.permute(0, 3, 1, 2)


class SimpleGate(nn.Module):
    """Product of the two halves of the channels."""

    def forward(self, x: Tensor) -> Tensor:
        a, b = x.chunk(2, dim=1)
        return a * b


class SpatialMean(nn.Module):
    """(B, C, H, W) -> (B, C, 1, 1) mean, or what stands for it in this thread."""

    def forward(self, x: Tensor) -> Tensor:
        return _here.mean(self, x)


def _mean(_: SpatialMean, x: Tensor) -> Tensor:
    return x.mean((2, 3), keepdim=True)


class _Here(threading.local):
    """How this thread takes means: threads share a network, whose modules hold nothing of one image.

    torch.compile traces through it, not through a ContextVar.
    """

    mean: Callable[[SpatialMean, Tensor], Tensor] = staticmethod(_mean)


_here = _Here()


class NAFBlock(nn.Module):
    """One block at constant width; the depthwise and the feed-forward part both expand by two."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        wide = 2 * channels
        self.norm1 = LayerNorm2d(channels)
        self.conv1 = nn.Conv2d(channels, wide, 1)
        self.conv2 = nn.Conv2d(wide, wide, 3, padding=1, groups=wide)
        self.sca = nn.Sequential(SpatialMean(), nn.Conv2d(channels, channels, 1))
        self.conv3 = nn.Conv2d(channels, channels, 1)
        self.norm2 = LayerNorm2d(channels)
        self.conv4 = nn.Conv2d(channels, wide, 1)
        self.conv5 = nn.Conv2d(channels, channels, 1)
        self.sg = SimpleGate()
        self.beta = nn.Parameter(torch.zeros(1, channels, 1, 1))
        self.gamma = nn.Parameter(torch.zeros(1, channels, 1, 1))

    def forward(self, x: Tensor) -> Tensor:
        gated = self.sg(self.conv2(self.conv1(self.norm1(x))))
        x = torch.addcmul(x, self.conv3(gated * self.sca(gated)), self.beta)
        return torch.addcmul(x, self.conv5(self.sg(self.conv4(self.norm2(x)))), self.gamma)


class NAFNet(nn.Module):
    """The U-Net.

    encoder_blocks, decoder_blocks: blocks per scale, finest first for the encoder and coarsest first for the
    decoder, equally many scales. The input may have more channels than the output (a noise map): the first
    `out_channels` of them are what the residual is added to. Any H and W: padded with zeros to `multiple`
    inside.
    """

    def __init__(
        self,
        in_channels: int,
        out_channels: int,
        width: int,
        encoder_blocks: tuple[int, ...],
        middle_blocks: int,
        decoder_blocks: tuple[int, ...],
    ) -> None:
        super().__init__()
        if len(encoder_blocks) != len(decoder_blocks):
            raise ValueError("encoder_blocks and decoder_blocks must name equally many scales")
        self.out_channels = out_channels
        self.intro = nn.Conv2d(in_channels, width, 3, padding=1)
        self.ending = nn.Conv2d(width, out_channels, 3, padding=1)
        self.encoders, self.decoders = nn.ModuleList(), nn.ModuleList()
        self.ups, self.downs = nn.ModuleList(), nn.ModuleList()
        for blocks in encoder_blocks:
            self.encoders.append(nn.Sequential(*[NAFBlock(width) for _ in range(blocks)]))
            self.downs.append(nn.Conv2d(width, 2 * width, 2, 2))
            width *= 2
        self.middle_blks = nn.Sequential(*[NAFBlock(width) for _ in range(middle_blocks)])
        for blocks in decoder_blocks:
            self.ups.append(nn.Sequential(nn.Conv2d(width, 2 * width, 1, bias=False), nn.PixelShuffle(2)))
            width //= 2
            self.decoders.append(nn.Sequential(*[NAFBlock(width) for _ in range(blocks)]))
        self.multiple = 2 ** len(encoder_blocks)
        self.receptive_radius = receptive_radius(encoder_blocks, middle_blocks, decoder_blocks)

    def forward(self, image: Tensor) -> Tensor:
        """(B, in_channels, H, W) -> (B, out_channels, H, W)."""
        height, width = image.shape[-2:]
        padded = functional.pad(image, (0, -width % self.multiple, 0, -height % self.multiple))
        x = self.intro(padded.contiguous(memory_format=torch.channels_last))
        skips = []
        for encoder, down in zip(self.encoders, self.downs, strict=True):
            x = encoder(x)
            skips.append(x)
            x = down(x)
        x = self.middle_blks(x)
        for decoder, up, skip in zip(self.decoders, self.ups, reversed(skips), strict=True):
            x = decoder(up(x) + skip)
        return (self.ending(x) + padded[:, : self.out_channels])[..., :height, :width]


def receptive_radius(encoder: tuple[int, ...], middle: int, decoder: tuple[int, ...]) -> int:
    """Pixels beyond which an output cannot depend on an input, `sca` aside.

    A block reaches 1 cell of its scale. Reach r at one scale is 2 r + 1 at the next finer one, because a
    pixel may lie at the far side of its 2x2 cell. `intro` and `ending` add 1 each.
    """
    radius = middle
    for down, up in zip(reversed(encoder), decoder, strict=True):
        radius = 2 * radius + 1 + down + up
    return radius + 2


def spatial_means(net: nn.Module) -> list[SpatialMean]:
    """All of them, in the order in which the blocks were made."""
    return [module for module in net.modules() if isinstance(module, SpatialMean)]


def pooling(net: nn.Module, run: Callable[[], object]) -> list[Tensor]:
    """What the spatial means of `net` gave during the one call in `run()`, (B, C, 1, 1) each."""
    seen: dict[SpatialMean, Tensor] = {}

    def seeing(mean: SpatialMean, x: Tensor) -> Tensor:
        seen[mean] = _mean(mean, x)
        return seen[mean]

    with _meaning(seeing):
        run()
    return [seen[mean] for mean in spatial_means(net)]


@contextmanager
def frozen_pooling(net: nn.Module, constants: Sequence[Tensor]) -> Iterator[None]:
    """Inside this context the spatial means of `net` are `constants`, (1, C, 1, 1) each, see `pooling`.

    In this thread: others may use `net` meanwhile.
    """
    frozen = dict(zip(spatial_means(net), constants, strict=True))
    with _meaning(lambda mean, x: frozen[mean] if mean in frozen else _mean(mean, x)):
        yield


@contextmanager
def _meaning(mean: Callable[[SpatialMean, Tensor], Tensor]) -> Iterator[None]:
    before, _here.mean = _here.mean, mean
    try:
        yield
    finally:
        _here.mean = before
