"""Under what circumstances a network was trained: command, hardware and time, one row per start of the run.

    sessions.json = [{command, hardware, processes, data, noise, held_out, first_step, last_step, seconds}]

`data` is the identity of the dataset, `noise` that of the profiles that are files ("" where none is),
`held_out` the keys of its images that are for validation: those of a run's beginning stay so when the dataset
grows. All three are absent in older runs.

They stand apart from checkpoint and weights, which hold what follows from settings and seed alone and so are
the same bits on every run on a CPU; the cards beside the weights repeat them. A row is brought up to date
with every checkpoint: what a kill loses of the time, it loses of the steps too.
"""

from __future__ import annotations

import json
import os
import platform
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch

from fsid.errors import FsidError
from fsid.files import write_atomically
from fsid.yaml_json import read_json

SESSIONS_FILE = "sessions.json"


class Session:
    """The row of a run that starts now at `first_step`.

    data: `fsid.dataset.index.dataset_digest`. noise: `fsid.sensor.profiles.profiles_digest`.
    """

    def __init__(
        self,
        run_dir: Path,
        command: str,
        first_step: int,
        processes: int,
        data: str,
        noise: str,
        held_out: Sequence[str],
    ) -> None:
        self._path, self._start = run_dir / SESSIONS_FILE, time.monotonic()
        self._before = read_sessions(run_dir)
        self._first_step = first_step
        self._row = {
            "command": command,
            "hardware": hardware(),
            "processes": processes,
            "data": data,
            "noise": noise,
            "held_out": list(held_out),
        }

    def save(self, step: int) -> None:
        """Write the file, with the time until now; a session without a step leaves no row."""
        if step > self._first_step:
            done = {"first_step": self._first_step, "last_step": step}
            seconds = round(time.monotonic() - self._start, 1)
            rows = [*self._before, {**self._row, **done, "seconds": seconds}]
            write_atomically(self._path, json.dumps(rows, indent=1).encode())


def read_sessions(run_dir: Path) -> list[dict[str, Any]]:
    """The rows of a run; none where the file is absent or was not written by FSID."""
    try:
        rows = read_json(run_dir / SESSIONS_FILE)
    except FsidError:
        return []
    return [row for row in rows if isinstance(row, dict)] if isinstance(rows, list) else []


def hardware() -> str:
    """One line: GPU or CPU, threads in use and PyTorch's version."""
    if torch.cuda.is_available():
        return f"{torch.cuda.get_device_name()}, PyTorch {torch.__version__}"
    return f"{_processor()}, {torch.get_num_threads()} of {os.cpu_count()} cores, PyTorch {torch.__version__}"


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as info:
            names = [line.partition(":")[2].strip() for line in info if line.startswith("model name")]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or platform.machine()
