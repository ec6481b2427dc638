"""How fast work goes and how long it will take, since its start: results may come in bursts.

rate = (done now - done at the start) / (time now - time of the start)
"""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import timedelta

_LINE_EVERY_S = 60.0


class Pace:
    """The work starts at the first `update`. clock: seconds."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._start: tuple[float, float] | None = None
        self._now = self._told = 0.0
        self._done = self._total = 0.0

    def update(self, done: float, total: float) -> None:
        """So much is done now."""
        self._now, self._done, self._total = self._clock(), done, total
        if self._start is None:
            self._start, self._told = (self._now, done), self._now

    @property
    def rate(self) -> float:
        """What is done in a second; 0 where nothing is done yet."""
        if self._start is None or self._now <= self._start[0]:
            return 0.0
        return (self._done - self._start[1]) / (self._now - self._start[0])

    @property
    def left(self) -> str:
        """The time left, h:mm:ss; "" where it is not known yet."""
        if not self.rate > 0:
            return ""
        seconds = (self._total - self._done) / self.rate - (self._clock() - self._now)
        return str(timedelta(seconds=round(max(0.0, seconds))))

    def line_due(self) -> bool:
        """Whether a log is to have a line now: a minute after the one before, while something is left."""
        if self._done >= self._total or self._now - self._told < _LINE_EVERY_S:
            return False
        self._told = self._now
        return True
