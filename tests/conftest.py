"""Shared by the tests: small data made on the spot, and the optional folder of real data."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import hypothesis
import numpy as np
import pytest
from PIL import Image

if TYPE_CHECKING:
    from fsid.render import Renderer

REPOSITORY = Path(__file__).resolve().parents[1]

hypothesis.settings.register_profile("fsid", deadline=None)  # how long a case takes is the machine's affair
hypothesis.settings.load_profile("fsid")


@pytest.fixture(scope="session")
def photos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with three small photographs, cut from one that scikit-image ships."""
    from skimage import data

    folder = tmp_path_factory.mktemp("photos")
    coffee = data.coffee()
    for i, (top, left) in enumerate([(0, 0), (100, 200), (200, 300)]):
        Image.fromarray(coffee[top : top + 160, left : left + 200]).save(folder / f"coffee-{i}.png")
    return folder


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The optional folder of real data (FSID_SHARED_DATA, or ../shared/data); skips where it is absent."""
    folder = Path(os.environ.get("FSID_SHARED_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"{folder}: no shared data here; set FSID_SHARED_DATA")
    return folder


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator with a fixed seed."""
    return np.random.default_rng(20261121)


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    """A renderer with the smallest textures, for all tests of a file."""
    from fsid.render import Renderer

    with Renderer(texture_size=64) as renderer:
        yield renderer


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Runs a command that must end with a line of its own and exit code 2; what it told on stderr."""
    from fsid.cli.main import main

    def run(*arguments: str | Path) -> str:
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            main([str(argument) for argument in arguments])
        assert stop.value.code == 2
        told = capsys.readouterr().err.rstrip("\n")
        assert told.rpartition("\n")[2].startswith("fsid: ")
        assert "Traceback" not in told
        return told

    return run
