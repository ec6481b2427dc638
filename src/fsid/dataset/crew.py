"""Workers that may die: tasks go in, results come out, and a lost worker costs its own task alone.

    for task, result in run(crew, tasks): ...           in the order in which they finish

A worker is a process here (`LocalCrew`) or an actor of a Ray cluster (`RayCrew`); the loop that feeds them is
one. It starts a new worker in place of a lost one and gives its task to the next that is free; one that waits
for a place on a cluster keeps no task from the others. The libraries' pools cannot do that:
`multiprocessing.Pool` waits for ever for the result of a killed worker, `ProcessPoolExecutor` gives up all
workers for one, and stops with tasks left where workers are to be replaced after a number of tasks (CPython
issue 115634), and `ray.util.multiprocessing.Pool` keeps sending tasks to an actor that is dead.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import traceback
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, Protocol, TypeVar

from fsid.errors import FsidError

T = TypeVar("T")
Work = Callable[[Any], Any]
MakeWork = Callable[[int | None], Work]
"""Called once in every new worker with the index of its GPU (None: not assigned); does one task per call."""

TRIES = 5
_NUMERIC_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_PATIENCE_S = 10.0


@dataclass(frozen=True)
class Lost:
    """In place of a result: the worker is gone."""

    reason: str


@dataclass(frozen=True)
class Ready:
    """In place of a result: the worker can take its first task."""


@dataclass(frozen=True)
class _Bug:
    """In place of a result: the work raised what is not bad input."""

    trace: str


class Crew(Protocol):
    """`size` workers by number, each of which does one task at a time."""

    @property
    def size(self) -> int: ...

    def start(self, worker: int) -> None:
        """A fresh worker under this number, which `wait` calls Ready; the one that had it is let go."""

    def send(self, worker: int, task: Any) -> None:
        """Give an idle worker a task."""

    def wait(self) -> list[tuple[int, Any]]:
        """Block until at least one is done or started: (worker, result, Ready or Lost)."""

    def stop(self) -> None:
        """End all workers, whatever they do."""


def run(
    crew: Crew,
    tasks: Sequence[T],
    *,
    tasks_per_worker: int,
    lost: Callable[[str], None] = lambda line: None,
) -> Iterator[tuple[T, Any]]:
    """(task, result) of every task as it is finished; results that are FsidError are raised.

    tasks_per_worker: a worker is replaced after so many. lost(line): called for every worker that died.
    Raises FsidError at the end where a task killed its worker `TRIES` times, or at once where no worker
    lives long enough to finish anything.
    """
    try:
        yield from _Shift(crew, tasks, tasks_per_worker, lost).results()
    finally:
        crew.stop()


class _Shift:
    """Who of a crew is at which of `tasks`, which are known by their place there."""

    def __init__(
        self, crew: Crew, tasks: Sequence[Any], tasks_per_worker: int, lost: Callable[[str], None]
    ) -> None:
        self._crew, self._tasks, self._tasks_per_worker, self._lost = crew, tasks, tasks_per_worker, lost
        self._queue = deque(range(len(tasks)))
        self._idle: list[int] = []
        self._busy: dict[int, int] = {}
        self._fallen: list[int] = []
        self._spoilt: list[int] = []
        self._done, self._deaths, self._barren = Counter[int](), Counter[int](), 0

    def results(self) -> Iterator[tuple[Any, Any]]:
        for worker in range(min(self._crew.size, len(self._tasks))):
            self._crew.start(worker)
        while self._queue or self._busy:
            for worker, result in self._crew.wait():
                task = self._busy.pop(worker, None)
                if isinstance(result, Lost):
                    self._replace(worker, task, result)
                elif isinstance(result, Ready):
                    self._idle.append(worker)
                else:
                    checked = _checked(result)
                    self._keep(worker)
                self._feed()
                if task is not None and not isinstance(result, Lost):
                    yield self._tasks[task], checked
        if self._spoilt:
            names = ", ".join(str(self._tasks[task]) for task in self._spoilt)
            raise FsidError(f"these killed their worker {TRIES} times: {names}; all others are done")

    def _feed(self) -> None:
        while self._queue and self._idle:
            worker = self._idle.pop(0)
            self._busy[worker] = self._queue.popleft()
            self._crew.send(worker, self._tasks[self._busy[worker]])

    def _replace(self, worker: int, task: int | None, loss: Lost) -> None:
        """One that dies as it starts, while others work, is started again when they have finished something:
        a machine of a cluster that can start none must not end the run."""
        place = "its start" if task is None else str(self._tasks[task])
        self._lost(f"worker {worker} died ({loss.reason}) at {place}")
        if task is not None:
            self._deaths[task] += 1
            (self._queue if self._deaths[task] < TRIES else self._spoilt).append(task)
        elif self._busy:
            self._fallen.append(worker)
            return
        self._barren += 1
        if self._barren == TRIES * self._crew.size:
            raise FsidError(_hopeless(loss, place))
        self._crew.start(worker)

    def _keep(self, worker: int) -> None:
        """It has done a task."""
        self._barren = 0
        self._done[worker] += 1
        if self._done[worker] % self._tasks_per_worker == 0 and self._queue:
            self._crew.start(worker)
        else:
            self._idle.append(worker)
        while self._fallen:
            self._crew.start(self._fallen.pop())


def _hopeless(last: Lost, place: str) -> str:
    return (
        f"no worker lives long enough to make anything: the last died at {place} ({last.reason}). "
        "Is there too little memory, does `python -c 'import fsid.dataset'` fail, or does a script of yours "
        "call fsid outside `if __name__ == '__main__':`, or come through a pipe (python < script.py)?"
    )


def _checked(result: Any) -> Any:
    if isinstance(result, FsidError):
        raise result
    if isinstance(result, _Bug):
        raise RuntimeError(f"a worker failed:\n{result.trace}")
    return result


def do_task(work: Work, task: Any) -> Any:
    """Bad input and bugs travel back as values: a raised error may lose its type on the way."""
    try:
        return work(task)
    except FsidError as error:
        return error
    except Exception:
        return _Bug(traceback.format_exc())


def thread_limits(threads: int) -> dict[str, str]:
    """Environment variables that keep a worker to so many threads.

    A worker of one thread rasterises in that thread (0 for Mesa's llvmpipe). With a thread beside it passes
    queue up, and places of the queue that are seldom used hold the shadow maps of long past scenes.
    """
    return {
        "LP_NUM_THREADS": str(threads if threads > 1 else 0),
        **dict.fromkeys(_NUMERIC_THREADS, str(threads)),
    }


class LocalCrew:
    """Spawned processes, each behind a pipe of its own.

    make_work: picklable. workers_per_gpu: worker w renders on GPU w // workers_per_gpu; 0 assigns none.
    """

    def __init__(self, size: int, make_work: MakeWork, workers_per_gpu: int = 0) -> None:
        self._size, self._make_work, self._workers_per_gpu = size, make_work, workers_per_gpu
        self._context = multiprocessing.get_context("spawn")
        self._members: dict[int, tuple[SpawnProcess, Connection]] = {}
        self._busy: set[int] = set()
        self._started: list[int] = []

    @property
    def size(self) -> int:
        return self._size

    def start(self, worker: int) -> None:
        if worker in self._members:
            self._members.pop(worker)[1].close()  # it ends at the end of its input
        ours, theirs = self._context.Pipe()
        gpu = worker // self._workers_per_gpu if self._workers_per_gpu else None
        process = self._context.Process(target=_serve, args=(theirs, self._make_work, gpu), daemon=True)
        threads = max(1, len(os.sched_getaffinity(0)) // self._size)
        with _environment(thread_limits(threads)):
            process.start()
        theirs.close()
        self._members[worker] = process, ours
        self._started.append(worker)

    def send(self, worker: int, task: Any) -> None:
        self._busy.add(worker)
        with suppress(OSError):  # a worker that is dead already is found by `wait`
            self._members[worker][1].send(task)

    def wait(self) -> list[tuple[int, Any]]:
        if self._started:  # the pipe keeps a task until the process reads it
            started, self._started = self._started, []
            return [(worker, Ready()) for worker in started]
        pipes: dict[Any, int] = {self._members[worker][1]: worker for worker in self._busy}
        return [(pipes[pipe], self._receive(pipes[pipe])) for pipe in wait(list(pipes))]

    def _receive(self, worker: int) -> Any:
        process, pipe = self._members[worker]
        self._busy.remove(worker)
        try:
            return pipe.recv()
        except (EOFError, OSError):
            process.join(_PATIENCE_S)
            return Lost(f"exit code {process.exitcode}")

    def stop(self) -> None:
        for process, pipe in self._members.values():
            pipe.close()
            process.terminate()
        for process, _ in self._members.values():
            process.join(_PATIENCE_S)
            process.kill()
            process.join()
        self._members.clear()


def _serve(pipe: Connection, make_work: MakeWork, gpu: int | None) -> None:
    """A worker's life. It ends with its input, and at once with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    threading.Thread(target=_follow_parent, daemon=True).start()
    work = make_work(gpu)
    with suppress(EOFError, OSError):
        while True:
            pipe.send(do_task(work, pipe.recv()))


def _follow_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """Defaults of environment variables for processes started inside: libraries read them when loaded."""
    new = {key: value for key, value in values.items() if key not in os.environ}
    os.environ.update(new)
    try:
        yield
    finally:
        for key in new:
            os.environ.pop(key, None)
