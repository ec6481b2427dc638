"""docs/scenes.md names every knob with its default: a guide that lags behind is worse than none."""

import dataclasses
import re
from pathlib import Path

import pytest

from fsid.scene import SceneConfig

GUIDE = Path(__file__).resolve().parents[1] / "docs" / "scenes.md"


def knobs():
    """(group or "", key, default)."""
    for field in dataclasses.fields(SceneConfig):
        value = getattr(SceneConfig(), field.name)
        if dataclasses.is_dataclass(value):
            yield from (
                (field.name, inner.name, getattr(value, inner.name)) for inner in dataclasses.fields(value)
            )
        else:
            yield "", field.name, value


def rows(group):
    """Key -> default as text, from the tables of a group; `group.key` and plain keys under its heading."""
    text = GUIDE.read_text(encoding="utf-8")
    out, inside = {}, ""
    for line in text.splitlines():
        if line.startswith("| key"):
            inside = (re.findall(r"`(\w+)`", line) or [""])[0]
        elif line.startswith("| `"):
            keys, defaults = line.split("|")[1:3]
            for key, default in zip(
                re.findall(r"`([\w.]+)`", keys), re.split(r", (?=[`n])", defaults), strict=True
            ):
                out[key if "." in key or not inside else f"{inside}.{key}"] = default.strip(" `")
    return {
        key.removeprefix(f"{group}."): value
        for key, value in out.items()
        if not group or key.startswith(group)
    }


@pytest.mark.parametrize(("group", "key", "default"), list(knobs()))
def test_every_knob_is_in_the_guide_with_its_default(group, key, default):
    stated = rows(group)[key]
    if isinstance(default, tuple):
        numbers = [float(x) for x in re.findall(r"[-\d.]+", stated)]
        assert numbers == pytest.approx(list(default))
    elif isinstance(default, bool):
        assert stated == str(default).lower()
    elif isinstance(default, str):
        assert stated == (default or "none")
    else:
        top, _, bottom = stated.partition("/")
        assert float(top) / float(bottom or 1) == pytest.approx(default)
