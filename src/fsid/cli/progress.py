"""A progress bar with rate and time left, as the `progress(done, total)` callback that the stages take.

Where there is no terminal, as in a batch job, a line a minute stands for the bar.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn
from rich.table import Column
from rich.text import Text

from fsid.pace import Pace
from fsid.plurals import counted
from fsid.terminal import Terminal


class _Speed(ProgressColumn):
    def __init__(self) -> None:
        super().__init__(Column(no_wrap=True))

    def render(self, task: Task) -> Text:
        return Text(_speed(task.fields["pace"], task.fields["unit"]), style="dim")


def _speed(pace: Pace, unit: str) -> str:
    return f"{pace.rate:.3g} {unit}/s, {pace.left} left" if pace.left else ""


class Bar:
    """`bar(done, total)` moves it, and shows it at the first call; `bar.failed(line)` counts a failure."""

    def __init__(self, bar: Progress, label: str, unit: str) -> None:
        self._bar, self._label, self._unit, self._pace, self._failures = bar, label, unit, Pace(), 0
        self._task = bar.add_task(label, total=None, visible=False, pace=self._pace, unit=unit, failures="")

    def then(self, label: str, unit: str) -> Bar:
        """Another below it, for what comes after it in the same call."""
        return Bar(self._bar, label, unit)

    def __call__(self, done: int, total: int) -> None:
        self._pace.update(done, total)
        self._bar.update(self._task, completed=done, total=total, visible=True)
        self._bar.start()
        if not self._bar.console.is_terminal and self._pace.line_due():
            line = f"{self._label}: {done}/{total} {_speed(self._pace, self._unit)}"
            self._bar.console.print(Text(line), soft_wrap=True)

    def failed(self, line: str) -> None:
        """Something failed that will be tried again; said with --quiet, too."""
        self._failures += 1
        console = Terminal(stderr=True) if self._bar.console.quiet else self._bar.console
        console.print(line, style="yellow", soft_wrap=True, markup=False)
        self._bar.update(self._task, failures=counted(self._failures, "failure"))


@contextmanager
def progress_bar(label: str, unit: str, *, quiet: bool) -> Iterator[Bar]:
    """Yields progress(done, total), both in `unit`s, for a `with` block; the bar appears at the first."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(table_column=Column(no_wrap=True)),  # where it is narrow, the bar is shorter
        _Speed(),
        TextColumn("[yellow]{task.fields[failures]}"),
    )
    bar = Progress(*columns, console=Terminal(stderr=True, quiet=quiet))
    try:
        yield Bar(bar, label, unit)
    finally:
        if bar.live.is_started:
            bar.stop()
