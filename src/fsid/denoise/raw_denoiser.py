"""One network for all cameras and ISOs: NAFNet between the stabilising transform and its inverse.

    y = stabilise(x),    top = stabilise(1) per site,
    ŷ = y + residual(2 y / top - 1/2, 40 / top - 1),    x̂ = unstabilise(ŷ)

In y the noise is N(0, 1) wherever it came from, so the residual that the network must produce is of one size
at every brightness and ISO, and it need not learn the noise law. The image itself enters scaled to its own
range (about -0.5 .. 1.5), because y runs to 100 at low ISO and to 20 at high; what that scaling hides, the
size of the noise relative to it, enters as four constant planes. The last convolution starts at zero: an
untrained network is the identity.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from fsid.denoise.nafnet import NAFNet
from fsid.denoise.stabilise import stabilise, unstabilise
from fsid.errors import FsidError

SITES = 4
_TYPICAL_TOP = 40.0  # of y at ISO 3200: brings the noise planes to order 1


@dataclass(frozen=True)
class NetworkConfig:
    """Size of the NAFNet: width at the finest scale, and blocks per scale."""

    width: int = 16
    encoder_blocks: tuple[int, ...] = (1, 1)
    middle_blocks: int = 1
    decoder_blocks: tuple[int, ...] = (1, 1)

    def __post_init__(self) -> None:
        if len(self.encoder_blocks) != len(self.decoder_blocks):
            raise FsidError("encoder_blocks and decoder_blocks: give equally many scales")
        blocks = (*self.encoder_blocks, self.middle_blocks, *self.decoder_blocks)
        if self.width < 1 or min(blocks) < 0:
            raise FsidError("width must be at least 1 and block counts at least 0")


class RawDenoiser(nn.Module):
    """Noisy packed RAW and its noise level to the clean estimate."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.net = NAFNet(
            2 * SITES, SITES, config.width, config.encoder_blocks, config.middle_blocks, config.decoder_blocks
        )
        for parameter in self.net.ending.parameters():
            nn.init.zeros_(parameter)
        for module in self.modules():
            if isinstance(module, nn.Conv2d) and module.kernel_size != (1, 1):
                module.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, noisy: Tensor, k: Tensor, sigma2: Tensor) -> Tensor:
        """noisy (B, 4, H, W) normalised, RGGB geometry; k, sigma2 (B, 4) -> (B, 4, H, W), not clipped."""
        k, sigma2 = k[:, :, None, None], sigma2[:, :, None, None]
        y = stabilise(noisy, k, sigma2)
        return unstabilise(y + self.residual(y, stabilise(torch.ones_like(k), k, sigma2)), k, sigma2)

    def residual(self, y: Tensor, top: Tensor) -> Tensor:
        """Clean minus noisy in the stabilised domain."""
        image = 2 * y / top - 0.5
        noise = (_TYPICAL_TOP / top - 1).expand_as(y)
        return self.net(torch.cat([image, noise], 1)) - image
