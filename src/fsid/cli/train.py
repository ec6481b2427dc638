"""fsid train: a denoiser from shards."""

from __future__ import annotations

from pathlib import Path

from tyro.conf import Positional

from fsid.cli.arguments import Output


def train(
    data: Positional[Path],
    *,
    output: Output,
    config: Path | None = None,
    set: tuple[str, ...] = (),  # noqa: A002  the option's fixed name
    resume: bool = False,
    quiet: bool = False,
) -> None:
    """Train NAFNet on the clean RAW of a dataset, with fresh noise at every draw, on a GPU or on the CPU.

    Writes the run's settings (config.yaml), the loss history and the weights (safetensors).

    Args:
        data: Folder made by fsid generate.
        output: Folder of the run.
        config: YAML file of settings, or the name of a built-in one: nafnet-tiny (CPU, minutes),
            nafnet-small (default: nafnet-tiny).
        set: Single settings, for example --set steps=20000 batch_size=16.
        resume: Continue the run in the folder where it stopped.
        quiet: No progress line.
    """
