"""The one line that a training shows: step, loss, PSNR, patches per second, time left.

Where there is no terminal, as in a batch job, it is a line a minute.
"""

from __future__ import annotations

from types import TracebackType

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
from rich.table import Column

from fsid.denoise.train_config import TrainConfig
from fsid.pace import Pace
from fsid.terminal import Terminal

_SMOOTHING = 0.05  # of the shown loss and PSNR, which jump from batch to batch
_WIDE = 100  # columns of a terminal that has room for a bar and the loss


class ProgressLine:
    """Context manager; nothing is shown where `quiet`."""

    def __init__(self, config: TrainConfig, step: int, processes: int, *, quiet: bool) -> None:
        console = Terminal(stderr=True, quiet=quiet)
        self._is_wide = console.width >= _WIDE
        columns = (
            TextColumn("train"),
            *((BarColumn(bar_width=20),) if self._is_wide else ()),
            MofNCompleteColumn(table_column=Column(no_wrap=True)),
            TextColumn("{task.fields[figures]}"),
            TextColumn("{task.fields[held_out]}"),
            TextColumn("{task.fields[rate]}"),
        )
        self._progress = Progress(*columns, console=console, disable=quiet)
        self._task = self._progress.add_task(
            "train", total=config.steps, completed=step, figures="", rate="", held_out=""
        )
        self._pace, self._steps = Pace(), config.steps
        self._pace.update(step, config.steps)
        self._batch = config.batch * processes
        self._shown: tuple[float, float] | None = None

    def __enter__(self) -> ProgressLine:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def update(self, step: int, loss: float, psnr: float) -> None:
        """Figures of the step just done."""
        old_loss, old_psnr = self._shown or (loss, psnr)
        loss, psnr = old_loss + _SMOOTHING * (loss - old_loss), old_psnr + _SMOOTHING * (psnr - old_psnr)
        self._shown = loss, psnr
        self._pace.update(step, self._steps)
        rate = f"{self._pace.rate * self._batch:.0f} patches/s, {self._pace.left} left"
        told = f"PSNR {psnr:.2f} dB"
        full = f"loss {loss:.3f}  {told}"
        self._progress.update(self._task, completed=step, figures=full if self._is_wide else told, rate=rate)
        if not self._progress.console.is_terminal and self._pace.line_due():
            self._progress.console.print(f"train: {step}/{self._steps}  {full}  {rate}", soft_wrap=True)

    def validated(self, psnr: float) -> None:
        """PSNR in dB on the held-out scenes."""
        self._progress.update(self._task, held_out=f"held out {psnr:.2f} dB")
