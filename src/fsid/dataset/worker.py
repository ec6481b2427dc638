"""What a worker keeps from task to task: its renderer, which opens when the first scene needs it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any, Protocol

from fsid.assets.survey import KNOWN, Survey
from fsid.dataset.config import GenerateConfig
from fsid.dataset.tasks import SceneRenderer
from fsid.render import Renderer, gpu_device


class Worker:
    """gpu: number of its GPU; None takes the first there is. Calling it does one task.

    surveys: what its parent knows of folders of meshes, textures and skies.
    """

    def __init__(self, gpu: int | None, surveys: Mapping[tuple[str, ...], Survey[Any]]) -> None:
        KNOWN.update(surveys)
        self._gpu = gpu
        self._open = ExitStack()
        self._renderer: SceneRenderer | None = None

    def __call__(self, task: Task) -> Any:
        return task.do(self)

    def renderer(self, config: GenerateConfig) -> SceneRenderer | None:
        """The renderer of `config`, kept open: all tasks of a worker are of one dataset."""
        if self._renderer is None:
            self._renderer = self._open.enter_context(rendering(config, self._gpu))
        return self._renderer


@contextmanager
def rendering(config: GenerateConfig, gpu: int | None = None) -> Iterator[SceneRenderer | None]:
    """The renderer that makes the frames of `config`, None for pictures. FsidError if it cannot run."""
    if config.images:
        yield None
    elif config.renderer == "reference":
        from fsid.render.reference import ReferenceRenderer

        yield ReferenceRenderer(texture_size=config.texture_px)
    else:
        with Renderer(
            device_index=None if gpu is None else gpu_device(gpu),
            supersampling=config.supersampling,
            texture_size=config.texture_px,
            quality=config.quality,
            lens_images=config.lens_images,
        ) as renderer:
            yield renderer


class Task(Protocol):
    """A piece of work that can be sent to a worker; `str(task)` names it in messages."""

    def do(self, worker: Worker) -> Any: ...
