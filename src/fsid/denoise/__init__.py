"""RAW denoising networks: train them on shards, load them, run them on files of any size.

The package itself can be called: `fsid.denoise(raw)` is `fsid.denoise.interface.denoise`, whose description
`help(fsid.denoise)` opens with.

OpenMP's threads sleep while they wait, unless the environment says otherwise: on a machine that others use
too, threads that spin keep each other from working (a training step on two threads took ten times as long).
OpenMP reads this once, when PyTorch is imported.
"""

import inspect
import os
import sys
from collections.abc import Callable
from importlib import import_module
from types import ModuleType

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

from fsid.denoise.denoise import Network, denoise_raw
from fsid.denoise.files import Noise, check_options, denoise_file, denoise_folder, find_raws, noise_of
from fsid.denoise.interface import denoise as _denoise
from fsid.denoise.interface import load_model
from fsid.denoise.model import Denoiser, ModelCard, load_denoiser, save_model
from fsid.denoise.raw_denoiser import NetworkConfig, RawDenoiser
from fsid.denoise.run_output import load_history
from fsid.denoise.train import train
from fsid.denoise.train_config import TrainConfig, train_config

__all__ = [
    "Denoiser",
    "ModelCard",
    "Network",
    "NetworkConfig",
    "Noise",
    "RawDenoiser",
    "TrainConfig",
    "check_options",
    "denoise_file",
    "denoise_folder",
    "denoise_raw",
    "find_raws",
    "load_denoiser",
    "load_history",
    "load_model",
    "noise_of",
    "save_model",
    "train",
    "train_config",
]


class CallablePackage(ModuleType):
    """What `fsid.denoise` is, for those who check types too: they see the call, and Any in its names."""

    __call__ = staticmethod(_denoise)

    def __reduce__(self) -> tuple[Callable[[str], ModuleType], tuple[str]]:
        """So that another process can be handed the function."""
        return import_module, (self.__name__,)


sys.modules[__name__].__class__ = CallablePackage
__signature__ = inspect.signature(_denoise)
__doc__ = f"{inspect.getdoc(_denoise)}\n\n{__doc__}"
