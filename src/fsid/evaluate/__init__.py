"""Metrics, test sets, comparisons and the report.

`fsid.evaluate.experiments` and `fsid.evaluate.demo` need PyTorch and are imported by name; a trained model
(`model_method`, `evaluate_models`) needs it when it is loaded; the rest runs without it.
"""

from fsid.evaluate.burst_truth import TruthQuality
from fsid.evaluate.bursts import burst_testset
from fsid.evaluate.classical import denoise_classical
from fsid.evaluate.compare import CLASSICAL, NOISY, Comparison, Method, compare
from fsid.evaluate.metrics import psnr, ssim
from fsid.evaluate.models import evaluate_models, model_method, write_comparison
from fsid.evaluate.results import Row, write_results
from fsid.evaluate.simulated import simulated_testset
from fsid.evaluate.testset import TestImage, TestSet, photo_testset, read_testset

__all__ = [
    "CLASSICAL",
    "NOISY",
    "Comparison",
    "Method",
    "Row",
    "TestImage",
    "TestSet",
    "TruthQuality",
    "burst_testset",
    "compare",
    "denoise_classical",
    "evaluate_models",
    "model_method",
    "photo_testset",
    "psnr",
    "read_testset",
    "simulated_testset",
    "ssim",
    "write_comparison",
    "write_results",
]
