"""One network for all cameras and ISOs: NAFNet between a transform that knows the noise and its inverse.

    image, planes = network_input(noisy, k, sigma2),      residual = NAFNet([image, planes]) - image
    clean = clean_estimate(noisy, residual, k, sigma2)

By default the noise is stabilised: in y it is N(0, 1) wherever it came from, so the residual is of one size
at every brightness and ISO, and the network need not learn the noise law. The image itself enters scaled to
its own range (about -0.5 .. 1.5), because y runs to 100 at low ISO and to 20 at high; what that hides, the
size of the noise relative to it, enters as four constant planes. See `conditioning` for the other ways. The
last convolution starts at zero: an untrained network is the identity.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from fsid.config import check_fields
from fsid.denoise.conditioning import Conditioning, clean_estimate, network_input
from fsid.denoise.nafnet import NAFNet
from fsid.errors import FsidError

SITES = 4
MAX_PATCH_PX = 2048
MAX_WIDTH, MAX_SCALES, MAX_BLOCKS = 4096, 10, 1000  # a card that asks for more lies: NAFNet-64 has 36 blocks


@dataclass(frozen=True)
class NetworkConfig:
    """Size of the NAFNet: width at the finest scale, and blocks per scale; and how it is told the noise."""

    width: int = 16
    encoder_blocks: tuple[int, ...] = (1, 1)
    middle_blocks: int = 1
    decoder_blocks: tuple[int, ...] = (1, 1)
    conditioning: Conditioning = "stabilise"

    def __post_init__(self) -> None:
        check_fields(self)
        if len(self.encoder_blocks) != len(self.decoder_blocks):
            raise FsidError("encoder_blocks and decoder_blocks: give equally many scales")
        blocks = (*self.encoder_blocks, self.middle_blocks, *self.decoder_blocks)
        if not 1 <= self.width <= MAX_WIDTH:
            raise FsidError(f"width {self.width}: must be 1 to {MAX_WIDTH}")
        if min(blocks) < 0 or sum(blocks) > MAX_BLOCKS or len(self.encoder_blocks) > MAX_SCALES:
            raise FsidError(
                f"block counts must not be negative, of at most {MAX_SCALES} scales and {MAX_BLOCKS} in all"
            )


class RawDenoiser(nn.Module):
    """Noisy packed RAW and its noise level to the clean estimate."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.conditioning = config.conditioning
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
        image, planes = network_input(noisy, k, sigma2, self.conditioning)
        residual = self.net(torch.cat([image, planes], 1)) - image
        return clean_estimate(noisy, residual, k, sigma2, self.conditioning)
