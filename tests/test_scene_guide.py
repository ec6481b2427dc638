"""Guides name every setting with its default: a guide that lags behind is worse than none."""

import dataclasses
import re
from functools import cache
from pathlib import Path

import pytest
import yaml

from fsid.config import to_plain
from fsid.dataset import GenerateConfig
from fsid.denoise import TrainConfig
from fsid.scene import SceneConfig

DOCS = Path(__file__).resolve().parents[1] / "docs"


def settings(config, prefix=""):
    """(dotted key, default); `scene` is one of its own."""
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        if not dataclasses.is_dataclass(value):
            yield f"{prefix}{field.name}", value
        elif not isinstance(value, SceneConfig):
            yield from settings(value, f"{prefix}{field.name}.")


@cache
def stated(guide):
    """Dotted key -> default as text, from the tables of a guide whose first column is `key`.

    Its head may name the group that plain keys are of.
    """
    out, group = {}, None
    for line in (DOCS / guide).read_text(encoding="utf-8").splitlines():
        if line.startswith("| key"):
            group = (re.findall(r"`(\w+)`", line) or [""])[0]
        elif not line.startswith("|"):
            group = None
        elif group is not None and line.startswith("| `"):
            keys, defaults = line.split("|")[1:3]
            for key, default in zip(
                re.findall(r"`([\w.]+)`", keys), re.split(r", (?=[`n])", defaults), strict=True
            ):
                out[key if "." in key or not group else f"{group}.{key}"] = default.strip(" `")
    return out


@pytest.mark.parametrize(("key", "default"), list(settings(SceneConfig())))
def test_every_knob_is_in_the_guide_with_its_default(key, default):
    text = stated("scenes.md")[key]
    if isinstance(default, tuple):
        numbers = [float(x) for x in re.findall(r"[-\d.]+", text)]
        assert numbers == pytest.approx(list(default))
    elif isinstance(default, bool):
        assert text == str(default).lower()
    elif isinstance(default, str):
        assert text == (default or "none")
    else:
        top, _, bottom = text.partition("/")
        assert float(top) / float(bottom or 1) == pytest.approx(default)


@pytest.mark.parametrize(
    ("guide", "config"), [("generate.md", GenerateConfig()), ("train-and-denoise.md", TrainConfig())]
)
def test_every_setting_is_in_the_guide_with_its_default(guide, config):
    found = {key: yaml.safe_load(text) for key, text in stated(guide).items()}
    assert found == {key: to_plain(default) for key, default in settings(config)}
