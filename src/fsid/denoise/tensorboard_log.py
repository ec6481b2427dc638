"""TensorBoard logs of a run, where `tensorboard` is installed; `history.json` holds the same figures.

A run that goes on from a checkpoint purges what the lost steps had logged.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fsid.errors import FsidError

LOG_FOLDER = "tensorboard"


class TensorBoardLog:
    """Writes scalars into RUN/tensorboard, or nothing where `wanted` is False or there is no tensorboard.

    step: of the checkpoint that the run goes on from, whose own figures stay; 0 where it starts. FsidError
    where the disk refuses them.
    """

    def __init__(self, run_dir: Path, step: int, *, wanted: bool) -> None:
        self._writer: Any = None
        self._folder = run_dir / LOG_FOLDER
        if wanted:
            try:
                from torch.utils.tensorboard import SummaryWriter
            except ImportError:
                return
            with self._refusals():
                self._writer = SummaryWriter(str(self._folder), purge_step=step + 1)

    def write(self, step: int, figures: Mapping[str, float]) -> None:
        """One point per figure at `step`."""
        if self._writer is not None:
            with self._refusals():
                for name, value in figures.items():
                    self._writer.add_scalar(name, value, step)

    def close(self) -> None:
        """Flush and end."""
        if self._writer is not None:
            with self._refusals():
                self._writer.close()

    @contextmanager
    def _refusals(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise FsidError(
                f"{self._folder}: cannot be written ({error.strerror}); tensorboard=false does without"
            ) from None
