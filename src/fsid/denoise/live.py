"""The one line that a training shows: step, loss, PSNR, patches per second, time left."""

from __future__ import annotations

from types import TracebackType

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from fsid.denoise.train_config import TrainConfig

_SMOOTHING = 0.05  # of the shown loss and PSNR, which jump from batch to batch


class LiveLine:
    """Context manager; nothing is shown where `quiet`."""

    def __init__(self, config: TrainConfig, step: int, processes: int, *, quiet: bool) -> None:
        columns = (
            TextColumn("train"),
            BarColumn(bar_width=20),
            MofNCompleteColumn(),
            TextColumn("{task.fields[figures]}"),
            TextColumn("{task.fields[held_out]}"),
            TextColumn("{task.fields[rate]}"),
            TimeRemainingColumn(),
        )
        self._progress = Progress(*columns, disable=quiet)
        self._task = self._progress.add_task(
            "train", total=config.steps, completed=step, figures="", rate="", held_out=""
        )
        self._batch = config.batch * processes
        self._shown: tuple[float, float] | None = None

    def __enter__(self) -> LiveLine:
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
        speed = self._progress.tasks[0].speed
        rate = f"{speed * self._batch:.0f} patches/s" if speed else ""
        figures = f"loss {loss:.3f}  PSNR {psnr:.2f} dB"
        self._progress.update(self._task, completed=step, figures=figures, rate=rate)

    def validated(self, psnr: float) -> None:
        """PSNR in dB on the held-out scenes."""
        self._progress.update(self._task, held_out=f"held out {psnr:.2f} dB")
