"""fsid export: a trained network as one file for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from fsid.terminal import Terminal


def export(
    run: Annotated[Positional[Path], arg(metavar="RUN")],
    output: Annotated[Positional[Path], arg(metavar="OUTPUT")],
    *,
    precision: Literal["float32", "float16", "int8"] | None = None,
    quiet: bool = False,
) -> None:
    """Export a trained network as ONNX, for any runtime, or as the one file that this package ships.

    The ONNX graph takes packed RAW of any size and its noise level; how to make and unmake that is written in
    the file's metadata. It is compared with PyTorch before it is written; what a smaller precision costs is
    measured on photographs and printed.

    Args:
        run: Folder of a training (fsid train), its model.safetensors, or the name of a shipped network.
        output: File to write, .onnx or .safetensors (with its card beside it, .json).
        precision: Of weights and, in ONNX, of computation; int8 is for ONNX. By default float32 for ONNX,
            and for .safetensors float16 where it costs less than 0.01 dB.
        quiet: Print nothing.
    """
    from fsid.denoise.export import export as export_network

    done = export_network(run, output, precision)
    if not quiet:
        agreement = f", differs from PyTorch by {done.difference:.1e}" if done.difference else ""
        Terminal(stderr=True).print(
            f"{done.file}: {done.precision}, {done.file.stat().st_size / 1e6:.2f} MB{agreement}; "
            f"{done.psnr:.2f} dB on photographs, of which the precision costs {done.loss_db:.3f} dB",
            soft_wrap=True,
            markup=False,
        )
