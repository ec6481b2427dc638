"""How fast the denoiser is: python bench/denoise.py [--threads N] [--side PX] [--model NAME=RUN ...].

Ratios within one run, all rivals taking turns, best of several. Two tables:
- a training step of NAFNet (forward, backward, AdamW; batch 4 of 64 packed pixels) against a plain
  transcription of the reference's block in the same PyTorch: standard memory layout, layer norm as an
  autograd function of its own. On a GPU ours runs as in training: bf16, torch.compile.
- denoising throughput in megapixels of mosaic per second under PyTorch and onnxruntime, against the classical
  denoiser (BM3D where installed, else non-local means) on one photograph. PSNR is shown for networks that are
  trained: --model nafnet-small=RUN.
With one thread the CPU time of the process is taken, which other programs on the machine disturb less.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from skimage import data
from torch import Tensor, nn

from fsid.denoise import Denoiser, ModelCard, Network, RawDenoiser, denoise_raw, load_denoiser, train_config
from fsid.denoise.nafnet import LayerNorm2d, NAFBlock
from fsid.denoise.onnx_denoiser import onnx_denoiser
from fsid.denoise.onnx_export import onnx_bytes
from fsid.denoise.train import noise_left
from fsid.evaluate.classical import bm3d_installed, denoise_classical
from fsid.sensor import Raw, clean_from_photo, load_profile, noisy_from_clean

NAMES = ("nafnet-tiny", "nafnet-small")
RUNS = 5
BATCH, PATCH_PX, ISO = 4, 64, 3200


class _PlainNorm(torch.autograd.Function):
    """Layer norm over channels with its gradient written out, (B, C, H, W), as the reference has it."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, bias: Tensor, eps: float) -> Tensor:
        mean = x.mean(1, keepdim=True)
        deviation = ((x - mean).pow(2).mean(1, keepdim=True) + eps).sqrt()
        y = (x - mean) / deviation
        ctx.save_for_backward(y, deviation, weight)
        return weight[:, None, None] * y + bias[:, None, None]

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, Tensor, Tensor, None]:
        y, deviation, weight = ctx.saved_tensors
        g = gradient * weight[:, None, None]
        inner = (g - y * (g * y).mean(1, keepdim=True) - g.mean(1, keepdim=True)) / deviation
        return inner, (gradient * y).sum((0, 2, 3)), gradient.sum((0, 2, 3)), None


class _PlainBlock(nn.Module):
    """The published block, step by step, on the parameters of one of ours."""

    def __init__(self, block: NAFBlock) -> None:
        super().__init__()
        self.b = block

    def forward(self, x: Tensor) -> Tensor:
        b = self.b
        y = b.conv2(b.conv1(_plain_norm(b.norm1, x)))
        first, second = y.chunk(2, dim=1)
        y = first * second
        y = b.conv3(y * b.sca[1](nn.functional.adaptive_avg_pool2d(y, 1)))
        y = x + y * b.beta
        first, second = b.conv4(_plain_norm(b.norm2, y)).chunk(2, dim=1)
        return y + b.conv5(first * second) * b.gamma


def _plain_norm(norm: LayerNorm2d, x: Tensor) -> Tensor:
    return _PlainNorm.apply(x, norm.weight, norm.bias, norm.eps)


def plain(net: RawDenoiser) -> RawDenoiser:
    """`net` with plain blocks and standard memory layout."""
    for module in list(net.modules()):
        if isinstance(module, nn.Sequential) and not isinstance(module, _PlainBlock):
            for name, child in list(module.named_children()):
                if isinstance(child, NAFBlock):
                    setattr(module, name, _PlainBlock(child))
    net.net.intro.register_forward_pre_hook(lambda m, given: given[0].contiguous())
    return net.to(memory_format=torch.contiguous_format)  # type: ignore[call-overload]


def clock() -> float:
    """Seconds: of the CPU with one thread, else of the wall."""
    alone = torch.get_num_threads() == 1 and not torch.cuda.is_available()
    return time.process_time() if alone else time.perf_counter()


def seconds(works: dict[str, Callable[[], object]], runs: int = RUNS) -> dict[str, float]:
    """Best time of each, taking turns, after one round that warms up."""
    best = dict.fromkeys(works, float("inf"))
    for run in range(runs + 1):
        for name, work in works.items():
            start = clock()
            work()
            if torch.cuda.is_available():
                torch.cuda.synchronize()
            if run:
                best[name] = min(best[name], clock() - start)
    return best


def step(net: RawDenoiser, device: str, compiled: bool) -> Callable[[], object]:
    """One training step of `net` on patches that are there already."""
    net = net.to(device)
    forward = torch.compile(net) if compiled else net
    optimizer = torch.optim.AdamW(net.parameters(), fused=True)
    clean = torch.rand(BATCH, 4, PATCH_PX, PATCH_PX, device=device)
    k, sigma2 = torch.full((BATCH, 4), 1e-3, device=device), torch.full((BATCH, 4), 1e-5, device=device)
    noisy = clean + 0.02 * torch.randn_like(clean)

    def work() -> None:
        optimizer.zero_grad()
        with torch.autocast(device, torch.bfloat16, enabled=device == "cuda"):
            estimate = forward(noisy, k, sigma2)
        noise_left(estimate.float(), clean, k, sigma2).backward()
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()

    return work


def training_table() -> None:
    device = "cuda" if torch.cuda.is_available() else "cpu"
    print(f"training step, {device}, {BATCH} patches of {PATCH_PX} packed pixels")
    for name in NAMES:
        config = train_config(name).network
        works = {
            "plain": step(plain(RawDenoiser(config)), device, False),
            "ours": step(RawDenoiser(config), device, device == "cuda"),
        }
        best = seconds(works)
        print(
            f"  {name}: plain {1e3 * best['plain']:.0f} ms, ours {1e3 * best['ours']:.0f} ms "
            f"({BATCH / best['ours']:.1f} patches/s): {best['plain'] / best['ours']:.2f} times as fast"
        )


def photograph(side_px: int) -> tuple[Raw, np.ndarray]:
    """A noisy RAW of `side_px` x `side_px` of a photograph, and its truth."""
    rng, profile = np.random.default_rng(0), load_profile("pixel6")
    picture = np.asarray(data.astronaut(), np.float32)[:side_px, :side_px] / 255
    clean = clean_from_photo(rng, picture, profile)
    return noisy_from_clean(rng, clean, ISO, profile.level(ISO)), clean.mosaic


def untrained(name: str) -> Denoiser:
    """A network of a configuration's size; its speed does not depend on its weights."""
    config = train_config(name)
    net = RawDenoiser(config.network).eval().requires_grad_(False)
    return Denoiser(net, ModelCard(config.network, config.patch_px), torch.device("cpu"))


def throughput_table(side_px: int, models: dict[str, str], threads: int, with_bm3d: bool) -> None:
    raw, clean = photograph(side_px)
    megapixels = raw.mosaic.size / 1e6
    networks: dict[str, Network] = {}
    for name in NAMES:
        denoiser = load_denoiser(models[name]) if name in models else untrained(name)
        networks[f"{name} torch"] = denoiser
        networks[f"{name} onnx"] = onnx_denoiser(onnx_bytes(denoiser), name, threads=threads)
    outputs: dict[str, np.ndarray] = {}

    def run(name: str, network: Network) -> Callable[[], object]:
        return lambda: outputs.__setitem__(name, denoise_raw(raw, network).mosaic)

    works = {name: run(name, network) for name, network in networks.items()}
    best = seconds(works)
    if with_bm3d:
        rival = "BM3D" if bm3d_installed() else "non-local means"
        start = clock()
        outputs[rival] = denoise_classical(raw).mosaic
        best[rival] = clock() - start
    print(f"denoising {raw.mosaic.shape[1]}x{raw.mosaic.shape[0]}, ISO {ISO}, {threads} threads")
    slowest = max(best.values())
    for name, time_s in best.items():
        known = name.split()[0] in models or name.split()[0] not in NAMES
        psnr = -10 * np.log10(np.mean((outputs[name] - clean) ** 2, dtype=float))
        quality = f", {psnr:.2f} dB" if known else ""
        print(f"  {name}: {megapixels / time_s:.3f} MP/s, {slowest / time_s:.1f} times the slowest{quality}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    parser.add_argument("--side", type=int, default=512, help="of the photograph, pixels, at most 512")
    parser.add_argument("--model", action="append", default=[], metavar="NAME=RUN")
    parser.add_argument("--no-bm3d", action="store_true", help="leave the classical denoiser out")
    given = parser.parse_args()
    torch.set_num_threads(given.threads)
    training_table()
    models = dict(pair.split("=", 1) for pair in given.model)
    throughput_table(given.side, models, given.threads, not given.no_bm3d)


if __name__ == "__main__":
    main()
