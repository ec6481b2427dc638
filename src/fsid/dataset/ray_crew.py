"""The crew of `crew.py` on a Ray cluster: one actor per worker.

Actors are used and not `ray.util.multiprocessing.Pool`, which goes on giving tasks to an actor that died. The
cluster's machines need the same FSID installed and every folder under the same path. Actors work in the
folder of the process that made the crew, so that relative paths mean the same to all.
"""

from __future__ import annotations

import logging
import os
import re
import signal
import socket
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import fsid
from fsid.assets.bake_cache import content_key
from fsid.dataset.crew import Lost, MakeWork, Ready, do_task, thread_limits
from fsid.errors import FsidError
from fsid.plurals import counted

_PATIENCE_S = 5.0
_DECIDING = {".py", ".glsl", ".frag", ".vert", ".yaml", ".npy"}
"""Of the files of FSID, those that pixels depend on."""


class _Member:
    """What runs on the cluster."""

    def __init__(self, make_work: MakeWork, has_gpu: bool, folder: str) -> None:
        import ray

        self._work = make_work(_gpu_number(ray.get_gpu_ids()) if has_gpu else None)
        self._folder = folder

    def ready(self, identity: str) -> Ready | FsidError:
        """Whether the machine has the FSID of `identity`, which decides what pairs look like."""
        if _identity() == identity:
            return Ready()
        return FsidError(
            f"--ray: {socket.gethostname()} has another FSID or NumPy ({_identity()}) than this machine "
            f"({identity}); install the same on all of them"
        )

    def do(self, task: Any) -> Any:
        return do_task(self._do_in_folder, task)

    def _do_in_folder(self, task: Any) -> Any:
        try:
            os.chdir(self._folder)
        except OSError as error:
            raise FsidError(
                f"--ray: {socket.gethostname()} cannot work in {self._folder} ({error.strerror}); "
                "run the command in a folder that all machines have"
            ) from None
        try:
            return self._work(task)
        except FsidError as error:  # of a file that the others may have
            raise FsidError(f"{error} (on {socket.gethostname()})") from None


@cache
def _identity() -> str:
    """The versions of FSID and NumPy, and a hash of FSID's files: a checkout changes without its version."""
    package = Path(fsid.__file__).parent
    files = sorted(path for path in package.rglob("*") if path.suffix in _DECIDING)
    key = content_key(bytes(file.relative_to(package)) + b"\0" + file.read_bytes() for file in files)
    return f"fsid {fsid.__version__}, files {key[:8]}, NumPy {np.__version__}"


def _gpu_number(ids: Sequence[Any]) -> int | None:
    """The number of the first of Ray's GPUs; None where it goes by names, as parts of a GPU do."""
    first = str(ids[0]) if ids else ""
    return int(first) if first.isdecimal() else None


class RayCrew:
    """Actors of one CPU each on a cluster. address: "auto", "ray://HOST:10001", or "local" for one here.

    workers_per_gpu: Ray gives every worker 1 / workers_per_gpu of a GPU; 0 asks for none.
    Raises FsidError where no cluster answers, or it has too few CPUs or GPUs for `size`.
    """

    def __init__(self, address: str, size: int, make_work: MakeWork, workers_per_gpu: int = 0) -> None:
        import ray

        _check_reachable(address)
        self._ray, self._size, self._make_work, self._folder = ray, size, make_work, os.getcwd()
        self._owns = not ray.is_initialized()
        try:
            if self._owns:
                with _own_sigterm():
                    ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
        except (ConnectionError, ValueError, RuntimeError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise FsidError(
                f"--ray {address}: no Ray cluster answers there ({reason}); if one is there, it may have "
                "another version of Ray, or ask for its token (RAY_AUTH_MODE=token)"
            ) from None
        lacking = _lacking(ray.cluster_resources(), size, workers_per_gpu)
        if lacking:
            self.stop()
            raise FsidError(lacking)
        share = 1 / workers_per_gpu if workers_per_gpu else 0
        self._has_gpu = share > 0
        threads = {"env_vars": thread_limits(1)}
        self._actor = ray.remote(num_cpus=1, num_gpus=share, runtime_env=threads)(_Member)
        self._members: dict[int, Any] = {}
        self._pending: dict[Any, int] = {}

    @property
    def size(self) -> int:
        return self._size

    def start(self, worker: int) -> None:
        if worker in self._members:
            self._ray.kill(self._members[worker])
        member: Any = self._actor.remote(self._make_work, self._has_gpu, self._folder)
        self._members[worker] = member
        self._pending[member.ready.remote(_identity())] = worker

    def send(self, worker: int, task: Any) -> None:
        self._pending[self._members[worker].do.remote(task)] = worker

    def wait(self) -> list[tuple[int, Any]]:
        ready, _ = self._ray.wait(list(self._pending), num_returns=1)
        return [(self._pending.pop(reference), self._result(reference)) for reference in ready]

    def _result(self, reference: Any) -> Any:
        try:
            return self._ray.get(reference)
        except self._ray.exceptions.RayError as error:
            return Lost(_reason(error))

    def stop(self) -> None:
        for member in getattr(self, "_members", {}).values():
            self._ray.kill(member)
        if self._owns:
            self._ray.shutdown()


@contextmanager
def _own_sigterm() -> Iterator[None]:
    """The handler of SIGTERM stays: Ray's, also below Python's, end the process before it can clear up."""
    handler = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        if handler is not None and threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, handler)


def _lacking(resources: Mapping[str, float], size: int, workers_per_gpu: int) -> str:
    """Why a cluster of so many "CPU" and "GPU" has no place for `size` workers, "" where it has."""
    cpus, gpus = (int(resources.get(key, 0)) for key in ("CPU", "GPU"))
    if cpus < size:
        return f"--workers {size}: the Ray cluster has {counted(cpus, 'CPU')}, one per worker is needed"
    if workers_per_gpu and gpus * workers_per_gpu < size:
        return (
            f"--workers {size}: the Ray cluster has {counted(gpus, 'GPU')} "
            f"for {workers_per_gpu} workers each (--workers-per-gpu)"
        )
    return ""


def _reason(error: Exception) -> str:
    """The kind of a loss, its machine, and what was raised there while it started, as far as Ray says so."""
    text = str(error)
    machine = re.search(r"\bip[=:]\s*([\w.]+)", text)
    raised = text.splitlines()[-1] if "creation task" in text else ""
    return type(error).__name__ + (f" on {machine[1]}" if machine else "") + (f": {raised}" if raised else "")


def _check_reachable(address: str) -> None:
    """FsidError where nobody listens at HOST:PORT; Ray itself would wait for minutes."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not port.isdecimal():
        return
    try:
        socket.create_connection((host, int(port)), _PATIENCE_S).close()
    except OSError as error:
        raise FsidError(
            f"--ray {address}: no Ray cluster answers there ({error.strerror or error})"
        ) from None
