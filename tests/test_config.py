"""Settings: overlays apply in order, and every mistake is one line that names the key."""

import re
from collections.abc import Iterator
from dataclasses import MISSING, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal, get_args, get_type_hints

import numpy as np
import pytest

from fsid.config import Override, from_plain, given_keys, load_settings, save_settings
from fsid.dataset import DatasetConfig, GenerateConfig, Workforce
from fsid.errors import FsidError
from fsid.scene import SceneConfig
from fsid.sensor import NoiseTerms


@dataclass(frozen=True)
class Inner:
    rate: float = 1.0
    names: tuple[str, ...] = ("a",)

    def __post_init__(self) -> None:
        if self.rate < 0:
            raise FsidError("rate: must not be negative")
        if not (self.rate or self.names):
            raise FsidError("give names or a rate")


@dataclass(frozen=True)
class Outer:
    count: int = 3
    wide: bool = False
    size_m: tuple[float, float] = (1.0, 2.0)
    inner: Inner = field(default_factory=Inner)
    fast: Literal["auto", "on", "off"] = "auto"


def test_later_overlays_win(tmp_path: Path):
    file = tmp_path / "c.yaml"
    file.write_text("count: 5\ninner: {rate: 2}\n")
    got = load_settings(Outer, file, ["inner.rate=1e-3", "inner.names=[x, y]", "wide=true"])
    assert got == Outer(5, True, (1.0, 2.0), Inner(1e-3, ("x", "y")))


def _settings() -> Iterator[Any]:
    """One of each kind."""
    yield from (GenerateConfig(), GenerateConfig().checks, Workforce(), NoiseTerms(), SceneConfig())
    yield from (getattr(SceneConfig(), f.name) for f in fields(SceneConfig) if f.default is MISSING)
    pytest.importorskip("torch")
    from fsid.dataset.loader import PatchConfig
    from fsid.denoise import TrainConfig
    from fsid.evaluate.demo import DemoConfig
    from fsid.evaluate.experiment_config import scale_config

    yield from (TrainConfig(), TrainConfig().network, DemoConfig(), scale_config("ablation", "cpu"))
    yield PatchConfig(32, 4, ("pixel6",), 400.0, 8000.0)


def test_settings_made_in_python_are_of_the_types_they_state():
    """A text is a list of letters for Python, a fraction a count, and any text true."""
    wrong = {int: [1.5, True, "1"], bool: ["no", 1], str: [5, ["a"]], float: [True, "a", None]}
    for settings in _settings():
        for key, kind in get_type_hints(type(settings)).items():
            fractions = [(1.5, 3.5)] if get_args(kind)[:1] == (int,) else []
            for value in (*wrong.get(kind, ["pixel6", None, 5]), *fractions):
                with pytest.raises(FsidError, match=rf"^{key}: .*"):
                    replace(settings, **{key: value})


def test_settings_made_in_python_are_those_of_a_file():
    config = GenerateConfig(width=np.int64(64), cameras=["pixel6"], images=Path("a"), iso_range=[400, 800])
    assert config == GenerateConfig(width=64, cameras=("pixel6",), images="a", iso_range=(400.0, 800.0))
    assert {type(value) for value in (config.width, *config.iso_range)} == {int, float}


def test_on_and_off_may_go_without_quotes():
    """YAML takes them for true and false."""
    for word in ("on", "off", "auto"):
        for text in (word, f"'{word}'"):
            assert load_settings(Outer, None, [f"fast={text}"]).fast == word


def test_a_pair_is_taken_as_it_is_and_texts_are_yaml():
    got = load_settings(Outer, None, [("inner.names", ["a #1"]), "count=4", ("count", 5), "inner.rate=2"])
    assert got == Outer(5, inner=Inner(2.0, ("a #1",)))


def test_saved_settings_load_back(tmp_path: Path):
    settings = Outer(count=7, inner=Inner(0.5, ("q",)))
    save_settings(settings, tmp_path / "c.yaml")
    assert load_settings(Outer, tmp_path / "c.yaml") == settings


def test_settings_made_in_python_are_saved(tmp_path: Path):
    """With NumPy's numbers, paths for texts and lists for tuples, which YAML has no words for."""
    settings = Outer(np.int64(7), np.bool_(True), [np.float32(0.5), 2.0], Inner(0.5, (Path("a/q"),)))
    save_settings(settings, tmp_path / "c.yaml")
    assert load_settings(Outer, tmp_path / "c.yaml") == Outer(7, True, (0.5, 2.0), Inner(0.5, ("a/q",)))


@pytest.mark.parametrize(
    ("override", "named"),
    [
        ("nonsense=1", "nonsense"),
        ("inner.nonsense=1", "nonsense"),
        ("count=2.5", "count"),
        ("count=yes", "count"),
        ("wide=1", "wide"),
        ("inner.rate=fast", "rate"),
        ("inner.rate=-1", "inner.rate"),
        ("size_m=[1]", "size_m"),
        ("size_m=[1, x]", "size_m"),
        ("fast=maybe", "fast: 'maybe' is not one of auto, on, off"),
        ("fast=[on]", "fast: [True] is not one of auto, on, off"),
        ("inner.names=mug", "names: 'mug' is not a list; write [mug]"),
        ("inner.names=[1]", "names"),
        ("count.x=1", "count"),
        ("count", "count"),
        ("count=[", "count"),
        ("count=2001-99-99", "count"),
        ("count=010", "count: is not valid YAML (010 begins with a zero; write the number without"),
        ("size_m=[-01, 2]", "size_m: is not valid YAML (-01 begins with a zero"),
        ("count=!!bool foo", "count"),
        pytest.param(f"count={'9' * 5000}", "count", id="too-many-digits"),
    ],
)
def test_a_mistake_is_one_line_that_names_the_key(override: str, named: str):
    with pytest.raises(FsidError) as caught:
        load_settings(Outer, None, [override])
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[1, 2]", "expected 'key: value' lines"),
        ("a: [", "not valid YAML"),
        ("!!python/object/apply:os.system ['true']", "not valid YAML"),
        ("\x00", "not valid YAML"),
        ("count: 2001-99-99", "month"),
        ('count: !!int "abc"', "abc"),
        ('count: !!int ""', "type that it states"),
        ("count: 0x_", "not valid YAML"),
        ("count: !!timestamp foo", "type that it states"),
        ("count: !!bool foo", "type that it states"),
        pytest.param("[" * 3000, "nested too deeply", id="deep"),
        ("1: 2", "no such key: 1"),
        ("count: 4\ncount: 5", "count is given twice"),
        ("inner: {rate: 2, rate: 3}", "rate is given twice"),
        ("count: &a [*a]", "or for themselves"),
        pytest.param(
            "a0: &a0 [1]\n" + "".join(f"a{i}: &a{i} [{f'*a{i - 1},' * 9}]\n" for i in range(1, 30)),
            "too many values",
            id="bomb",
        ),
    ],
)
def test_a_broken_file_is_one_line_that_names_it(tmp_path: Path, text: str, words: str):
    file = tmp_path / "broken.yaml"
    file.write_text(text)
    with pytest.raises(FsidError, match=rf"broken\.yaml: .*{words}") as caught:
        load_settings(Outer, file)
    assert "\n" not in str(caught.value)


def test_values_are_counted_while_they_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Each takes a kilobyte: a file of 64 MiB may hold 30 million."""
    monkeypatch.setattr("fsid.yaml_json._MOST_NODES", 100)
    file = tmp_path / "long.yaml"
    file.write_text("inner: {names: [" + "x, " * 101 + "]}\n{")  # what is broken comes after them
    with pytest.raises(FsidError, match=r"long\.yaml: is not valid YAML \(it has more than 100 values\)"):
        load_settings(Outer, file)


def test_a_merged_key_may_be_overridden(tmp_path: Path):
    file = tmp_path / "merged.yaml"
    file.write_text("inner: {<<: {rate: 2, names: [x]}, rate: 3}")
    assert load_settings(Outer, file).inner == Inner(3.0, ("x",))


@pytest.mark.parametrize("plain", [["count"], None, 3, "count"])
def test_what_has_no_keys_is_no_settings(plain: object):
    with pytest.raises(FsidError, match=r"from here: expected keys"):
        from_plain(Outer, plain, source="from here")


def test_a_missing_file_is_named(tmp_path: Path):
    with pytest.raises(FsidError, match=r"none\.yaml"):
        load_settings(Outer, tmp_path / "none.yaml")


def test_a_refusal_says_where_the_value_came_from(tmp_path: Path) -> None:
    """A command's own options are handed over as pairs; nobody wrote --set for these."""
    file = tmp_path / "mine.yaml"
    file.write_text("count: 2")
    wrong: list[tuple[Path | None, list[Override], str]] = [
        (None, [("count", "x")], "options: count"),
        (None, ["count=x"], "--set: count"),
        (file, ["count=x", ("wide", True)], "--set: count"),
        (file, ["count=4", ("wide", 3)], "options: wide"),
        (file, ["nonsense=1", ("wide", True)], "--set: no such key: nonsense"),
        (None, ["inner={rate: x}", "wide=true", ("inner.rate", "y")], "options: inner.rate"),
    ]
    for config, overrides, named in wrong:
        with pytest.raises(FsidError, match=rf"^{named}"):
            load_settings(Outer, config, overrides)


def test_a_file_that_is_at_fault_is_named_alone_or_with_its_accomplice(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("inner: 3")
    with pytest.raises(FsidError, match=r"^\S*mine\.yaml: inner: "):
        load_settings(Outer, file, ["count=4", ("wide", True)])
    with pytest.raises(FsidError, match=r"mine\.yaml and --set: inner\.rate: inner is a single value"):
        load_settings(Outer, file, ["inner.rate=4", ("wide", True)])


def test_the_advice_for_a_list_is_one_of_the_right_length():
    with pytest.raises(FsidError, match=r"size_m: 5 is not a list; write \[5,5\]") as caught:
        load_settings(Outer, None, ["size_m=5"])
    advice = str(caught.value).rpartition(" ")[2]
    assert load_settings(Outer, None, [f"size_m={advice}"]).size_m == (5.0, 5.0)


def test_a_value_that_its_group_refuses_is_named_by_its_whole_key(tmp_path: Path):
    file = tmp_path / "mine.yaml"
    file.write_text("scene: {background: {tile_scale: [9, 1]}}")
    with pytest.raises(FsidError, match=r"mine\.yaml: scene\.background\.tile_scale = \(9\.0, 1\.0\): give"):
        load_settings(GenerateConfig, file)
    for override, line in (
        ("scene.materials.tile_scale=[9,1]", "scene.materials.tile_scale = (9.0, 1.0): give two numbers"),
        ("scene.mesh_families=[mugg]", "scene.mesh_families: 'mugg' does not exist"),
        ("checks.black_share=2", "checks.black_share: 2.0 is not between"),
        ("width=3", "width: 3 is not an even"),
    ):
        with pytest.raises(FsidError, match=f"^--set: {re.escape(line)}"):
            load_settings(GenerateConfig, None, [override])
    dataset = {"seed": 0, "shard_size": 1, "generate": {"checks": {"duplicate_bits": 999}}}
    with pytest.raises(FsidError, match=r"^x: generate\.checks\.duplicate_bits: 999 is not"):
        from_plain(DatasetConfig, dataset, source="x")


def test_what_is_said_of_no_single_key_comes_after_its_group():
    with pytest.raises(FsidError, match=r"^--set: inner: give names or a rate$"):
        load_settings(Outer, None, ["inner={rate: 0, names: []}"])


def test_given_keys_are_single_settings_also_inside_of_groups():
    given: list[Override] = ["inner.rate=2", "inner={rate: 3, names: [x]}", ("count", 4), "inner={}"]
    assert given_keys(given) == ["inner.rate", "inner.rate", "inner.names", "count"]
