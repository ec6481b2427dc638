"""RAW denoising networks: train them on shards, load them, run them on files of any size.

OpenMP's threads sleep while they wait, unless the environment says otherwise: on a machine that others use
too, threads that spin keep each other from working (a training step on two threads took ten times as long).
OpenMP reads this once, when PyTorch is imported.
"""

import os

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

from fsid.denoise.denoise import denoise_raw
from fsid.denoise.files import MosaicLayout, denoise_file
from fsid.denoise.model import Denoiser, ModelCard, load_model, save_model
from fsid.denoise.raw_denoiser import NetworkConfig, RawDenoiser
from fsid.denoise.train import load_history, train
from fsid.denoise.train_config import TrainConfig, train_config

__all__ = [
    "Denoiser",
    "ModelCard",
    "MosaicLayout",
    "NetworkConfig",
    "RawDenoiser",
    "TrainConfig",
    "denoise_file",
    "denoise_raw",
    "load_history",
    "load_model",
    "save_model",
    "train",
    "train_config",
]
