"""A progress bar with rate and time left, as the `progress(done, total)` callback that the stages take."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)
from rich.text import Text


class _Rate(ProgressColumn):
    def __init__(self, unit: str) -> None:
        super().__init__()
        self._unit = unit

    def render(self, task: Task) -> Text:
        speed = task.finished_speed or task.speed
        return Text(f"{speed:.2f} {self._unit}/s" if speed else "", style="dim")


class Bar:
    """`bar(done, total)` moves it, and shows it at the first call; `bar.failed(line)` counts a failure."""

    def __init__(self, bar: Progress, task: TaskID) -> None:
        self._bar, self._task, self._failures = bar, task, 0

    def __call__(self, done: int, total: int) -> None:
        self._bar.start()
        self._bar.update(self._task, completed=done, total=total)

    def failed(self, line: str) -> None:
        """Something failed that will be tried again."""
        self._failures += 1
        self._bar.console.print(line, style="yellow", soft_wrap=True, markup=False)
        self._bar.update(self._task, failures=f"{self._failures} failures")


@contextmanager
def progress_bar(label: str, unit: str, *, quiet: bool) -> Iterator[Bar]:
    """Yields progress(done, total), both in `unit`s, for a `with` block; the bar appears at the first."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        _Rate(unit),
        TimeRemainingColumn(),
        TextColumn("[yellow]{task.fields[failures]}"),
    )
    bar = Progress(*columns, console=Console(stderr=True, quiet=quiet))
    task = bar.add_task(label, total=None, failures="")
    try:
        yield Bar(bar, task)
    finally:
        bar.stop()
