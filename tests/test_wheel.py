"""The wheel holds everything that runs: code, shaders, profiles, configurations, the report's template.
The source archive holds what makes the same wheel, and what `make` needs."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built("wheel", REPOSITORY, tmp_path_factory.mktemp("wheel"))


def built(kind: str, source: Path, out: Path) -> Path:
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(out)],
        cwd=source,
        check=True,
        capture_output=True,
    )
    (file,) = out.iterdir()
    return file


def test_every_file_of_the_package_is_in_the_wheel(wheel: Path):
    package = REPOSITORY / "src" / "fsid"
    expected = {
        str(Path("fsid") / path.relative_to(package))
        for path in package.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    with zipfile.ZipFile(wheel) as archive:
        assert expected <= set(archive.namelist())
    assert {path.rpartition(".")[2] for path in expected} >= {"py", "glsl", "yaml", "j2", "typed"}


def test_the_source_archive_makes_the_same_wheel_and_holds_what_make_needs(wheel: Path, tmp_path: Path):
    with tarfile.open(built("sdist", REPOSITORY, tmp_path / "sdist")) as archive:
        archive.extractall(tmp_path / "source", filter="data")
    (source,) = (tmp_path / "source").iterdir()
    again = built("wheel", source, tmp_path / "again")
    with zipfile.ZipFile(wheel) as here, zipfile.ZipFile(again) as there:
        assert set(there.namelist()) == set(here.namelist())
    subprocess.run(["make", "--dry-run", "test"], cwd=source, check=True, capture_output=True)


def test_the_wheel_alone_runs(wheel: Path, tmp_path: Path):
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "site")}
    script = (
        "import fsid, sys; assert fsid.__file__.startswith(sys.argv[1]), fsid.__file__;"
        "from fsid.cli.main import main;"
        "main(['generate', 'out', '--count', '1', '--width', '64', '--height', '64', '--quiet']);"
        "main(['profiles', 'pixel6'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "site")],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "shard-00000.tar").exists()
