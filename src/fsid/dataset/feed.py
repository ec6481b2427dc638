"""Batches that other processes make, in shared memory that is used again and again.

    slot of the i-th batch = i mod R,      R = batches asked for ahead + the one that is in use

A page of fresh shared memory costs a fault and a clearing, for batches of patches more than what is computed
into it. So the slots are made once, before the processes that fill them; what travels through the queue is
the number of a step.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Generator

from torch.utils.data import DataLoader, Dataset

from fsid.dataset.loader import Batch, PatchDataset
from fsid.errors import FsidError

_AHEAD = 2  # batches that each process is asked for beyond the one in use


def batches(
    patches: PatchDataset, steps: range, processes: int = 0, *, pin: bool = False
) -> Generator[Batch, None, None]:
    """`patches[step]` for all `steps`, made by so many other processes; 0: here.

    A batch of other processes is valid until the next one is asked for: clone the tensors that are to be
    kept. (Clones of all of them cost an eighth of the patches per second, and training keeps none.)
    pin: into page-locked memory of its own, from which a GPU copies faster; it stays valid.
    FsidError where shared memory has no room for them, or as `patches[step]`.
    """
    if not processes:
        made = (patches[step] for step in steps)
    else:
        ring = _shared([patches.empty_batch() for _ in range(_AHEAD * processes + 1)])
        slots = DataLoader(
            _Slots(patches, steps, ring),
            batch_size=None,
            num_workers=processes,
            prefetch_factor=_AHEAD,
            worker_init_fn=_leave_signals_to_parent,
        )
        made = (ring[_checked(slot)] for slot in slots)
    for batch in made:
        yield batch.pin_memory() if pin else batch


def _leave_signals_to_parent(worker: int) -> None:
    """In a worker: Ctrl-C and a closed terminal are for the parent to handle, SIGTERM is no error.

    All three reach every process of a group. PyTorch raises in the parent where a worker dies of one, and
    waits for ever for one that took over a handler of the parent by which it ignores the SIGTERM to end it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda number, frame: os._exit(0))


def _checked(slot: int | FsidError) -> int:
    if isinstance(slot, FsidError):
        raise slot
    return slot


class _Slots(Dataset[int | FsidError]):
    """`slots[i]` fills the slot of the i-th step and says which one it is.

    Bad input travels back as a value: PyTorch makes the traceback part of the line of what is raised.
    """

    def __init__(self, patches: PatchDataset, steps: range, ring: list[Batch]) -> None:
        self._patches, self._steps, self._ring = patches, steps, ring

    def __len__(self) -> int:
        return len(self._steps)

    def __getitem__(self, place: int) -> int | FsidError:
        slot = place % len(self._ring)
        try:
            self._patches.fill(self._ring[slot], self._steps[place])
        except FsidError as error:
            return error
        return slot


def _shared(ring: list[Batch]) -> list[Batch]:
    try:
        return [Batch(*(tensor.share_memory_() for tensor in batch.tensors)) for batch in ring]
    except RuntimeError as error:
        if "shared memory" not in str(error):
            raise
    size_mb = sum(tensor.nbytes for batch in ring for tensor in batch.tensors) / 1e6
    raise FsidError(
        f"loader_processes: these need {size_mb:.0f} MB of shared memory (/dev/shm), which has less room; "
        "give it more (docker run --shm-size), or take fewer of them: 0 needs none"
    )
