"""Data flows one way: a folder imports only from the folders above it, and PyTorch stays an extra."""

from __future__ import annotations

import ast
import os
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


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_what_holds_arrays_is_equal_to_itself_alone(path: Path):
    """A dataclass's own == asks for the truth of arrays that are compared, and raises."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ClassDef):
            types = [ast.unparse(part.annotation) for part in node.body if isinstance(part, ast.AnnAssign)]
            made = [text for text in map(ast.unparse, node.decorator_list) if text.startswith("dataclass")]
            if any("ndarray" in text or "Tensor" in text for text in types):
                assert all("eq=False" in text for text in made), node.name


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_what_is_printed_goes_through_the_terminal_that_shows_control_characters(path: Path):
    assert "rich.console.Console" not in imported(path)


def test_pairs_need_no_pytorch():
    script = (
        "import sys, fsid.dataset, fsid.evaluate, fsid.evaluate.doctor, fsid.cli.main;"
        "sys.exit('torch' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


def test_packages_are_found_by_name():
    """`fsid.sensor` must not depend on what was called before, and Jupyter completes what it is told of."""
    script = (
        "import sys, fsid; assert 'torch' not in sys.modules and 'numpy' not in sys.modules;"
        "fsid.sensor.load_profile('pixel6'); fsid.render.Renderer; fsid.dataset.generate;"
        "sys.exit(not {*fsid.__all__, 'sensor', 'evaluate'} <= set(dir(fsid)))"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


def test_types_are_seen_by_those_who_use_them(tmp_path: Path):
    """`denoise` is a package and a function: a type checker must see both."""
    script = tmp_path / "script.py"
    script.write_text(
        "import fsid\nimport fsid.denoise\nfrom fsid.denoise import load_model\n\n"
        "fsid.denoise()\nfsid.load_model(2)\nload_model(2)\nfsid.denoise.train_config('nafnet-tiny')\n",
        "utf-8",
    )
    seen = [PACKAGE / name for name in ("__init__.py", "denoise/__init__.py", "denoise/interface.py")]
    options = ["--strict", "--follow-imports=skip", f"--cache-dir={tmp_path}", "--config-file="]
    environment = {**os.environ, "MYPYPATH": str(PACKAGE.parent)}
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *options, str(script), *map(str, seen)],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    found = [line for line in done.stdout.splitlines() if line.startswith(str(script))]
    assert len(found) == 3, done.stdout
    assert ":5: error: Too few arguments" in found[0]
    for line in found[1:]:
        assert 'Argument 1 to "load_model" has incompatible type "int"' in line
    assert (PACKAGE / "py.typed").is_file()
