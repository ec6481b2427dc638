"""What a worker keeps from task to task: its renderer, which opens when the first scene needs it."""

from __future__ import annotations

from typing import Any, Protocol

from fsid.dataset.config import GenerateConfig
from fsid.render import Renderer


class Worker:
    """gpu: index of its GPU; None takes the first there is. Calling it does one task."""

    def __init__(self, gpu: int | None) -> None:
        self._gpu = gpu
        self._renderer: Renderer | None = None

    def __call__(self, task: Task) -> Any:
        return task.do(self)

    def renderer(self, config: GenerateConfig) -> Renderer | None:
        """The renderer that makes the frames of `config`; None where they come from pictures.

        All tasks of a worker are of one dataset, so its settings do not change.
        """
        if config.images:
            return None
        if self._renderer is None:
            self._renderer = Renderer(
                device_index=self._gpu, supersampling=config.supersampling, texture_size=config.texture_px
            )
        return self._renderer


class Task(Protocol):
    """A piece of work that can be sent to a worker; `str(task)` names it in messages."""

    def do(self, worker: Worker) -> Any: ...
