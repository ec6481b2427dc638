"""What a machine cannot do for a training, as one line that names the setting."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch

from fsid.denoise.train_config import TrainConfig
from fsid.errors import FsidError

_WORKER = "DataLoader worker"  # how its error begins


@contextmanager
def machine_limits(config: TrainConfig) -> Iterator[None]:
    """FsidError where a GPU's memory does not hold a step, where torch.compile finds no compiler, and where a
    loader process was killed."""
    try:
        yield
    except torch.OutOfMemoryError:
        raise FsidError(
            f"batch {config.batch}, patch_px {config.patch_px}: the GPU's memory does not hold them; "
            "lower one of the two"
        ) from None
    except RuntimeError as error:
        if str(error).startswith(_WORKER):  # PyTorch raises it at whatever line the parent is
            raise FsidError(
                f"loader_processes: {str(error).strip(' .')}; where memory ran out take fewer of them, "
                "and the same command goes on"
            ) from None
        from torch._dynamo.exc import BackendCompilerFailed  # here, since its import takes a second

        if not isinstance(error, BackendCompilerFailed):
            raise
        reason = " ".join(str(error).partition("\n\n")[0].split())
        raise FsidError(
            f"compile: torch.compile fails here ({reason}); install the C++ compiler that it needs, "
            "or set compile=off, which is slower"
        ) from None
