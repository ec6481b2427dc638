"""Data flows one way: a folder imports only from the folders above it, and PyTorch stays an extra."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "src" / "fsid"
ORDER = ("assets", "scene", "render", "sensor", "dataset", "denoise", "evaluate", "cli")
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path.parent != PACKAGE)


def imported(path: Path) -> set[str]:
    """Full names of all modules that a file imports, anywhere in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_folder_imports_only_from_above(path: Path):
    own = ORDER.index(path.relative_to(PACKAGE).parts[0])
    for name in imported(path):
        if name.startswith("fsid."):
            folder = name.split(".")[1]
            assert folder not in ORDER or ORDER.index(folder) <= own, name


def test_pairs_need_no_pytorch():
    script = (
        "import sys, fsid.dataset, fsid.evaluate, fsid.evaluate.doctor, fsid.cli.main;"
        "sys.exit('torch' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
