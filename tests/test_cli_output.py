"""What a command prints, and where nobody reads it."""

from __future__ import annotations

import errno
import io
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rich.progress import Progress, TextColumn
from rich.table import Table
from rich.text import Text

from fsid import __version__
from fsid.cli import main as cli
from fsid.cli import progress
from fsid.pace import Pace
from fsid.terminal import Terminal


def test_a_notebook_without_widgets_has_lines(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture):
    """rich would show nothing there but a warning to install ipywidgets."""
    pytest.importorskip("torch")
    from fsid.denoise import TrainConfig
    from fsid.denoise.progress_line import ProgressLine

    monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    monkeypatch.setattr("fsid.terminal.find_spec", lambda name: None)
    with ProgressLine(TrainConfig(steps=9), 0, 1, quiet=False) as line:
        line._pace._told -= 100
        line.update(1, 0.5, 30.0)
    assert "train: 1/9  loss 0.500" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["--help"], ["generate", "--help"], ["profiles", "--help"]])
def test_a_closed_pipe_ends_a_command_quietly(arguments: list[str]) -> None:
    """As `fsid ... | head` does."""
    read, write = os.pipe()
    os.close(read)
    ended = subprocess.run(
        [sys.executable, "-m", "fsid", *arguments], stdout=write, stderr=subprocess.PIPE, text=True
    )
    os.close(write)
    assert (ended.returncode, ended.stderr) == (141, "")


def test_a_pipe_that_broke_elsewhere_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """As that of a worker that died: it must not pass for a closed output."""

    def broken(arguments: object) -> None:
        raise BrokenPipeError

    monkeypatch.setattr(cli, "_run", broken)
    with pytest.raises(BrokenPipeError):
        cli.main([])


def test_an_interrupt_while_modules_are_read_is_one_line() -> None:
    script = (
        "import sys, fsid.__main__\n"
        "class Interrupt:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'fsid.cli.main': raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Interrupt())\n"
        "fsid.__main__.main()\n"
    )
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (130, "fsid: interrupted\n")


@pytest.mark.parametrize("options", ["--count 1", "--count 1 --dry-run", "--only 3", "--only=3", "--dry_run"])
def test_only_what_keeps_something_goes_on_from_it(
    options: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "_documented", interrupted)
    with pytest.raises(SystemExit) as ended:
        cli.main(["generate", "out", *options.split()])
    assert ended.value.code == 130
    hint = "; the same command goes on from what is finished" if options == "--count 1" else ""
    assert capsys.readouterr().err == f"fsid: interrupted{hint}\n"


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
@pytest.mark.parametrize("arguments", [["--help"], ["profiles"], ["generate", "--help"]])
def test_a_full_disk_under_the_output_is_one_line(arguments: list[str]) -> None:
    with open("/dev/full", "wb") as full:
        ended = subprocess.run(
            [sys.executable, "-m", "fsid", *arguments], stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert (ended.returncode, ended.stderr) == (2, "fsid: No space left on device\n")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_a_full_disk_under_standard_error_leaves_the_exit_code() -> None:
    """As of `fsid ... 2> log`: neither a refusal nor a note can be told."""
    for arguments in (["profiles", "none"], ["doctor"]):
        with open("/dev/full", "wb") as full:
            ended = subprocess.run(
                [sys.executable, "-c", NOTE, *arguments], stdout=subprocess.DEVNULL, stderr=full
            )
        assert ended.returncode == 2, arguments


def test_a_closed_pipe_under_standard_error_is_told_by_the_exit_code() -> None:
    """A refusal stays one; what cannot print how far it is ends as where its output is closed."""
    for arguments, code in ((["profiles", "none"], 2), (["doctor"], 141)):
        read, write = os.pipe()
        os.close(read)
        ended = subprocess.run(
            [sys.executable, "-c", NOTE, *arguments], stdout=subprocess.DEVNULL, stderr=write
        )
        os.close(write)
        assert ended.returncode == code, arguments


NOTE = """
import fsid.cli.main as cli
from fsid.terminal import Terminal
cli.COMMANDS["doctor"] = lambda: Terminal(stderr=True).print("a note")
cli.main()
"""


@pytest.mark.parametrize("arguments", ["--help", "profiles", "profiles --help"])
def test_a_closed_output_does_not_fail_a_command(arguments: str) -> None:
    """As `fsid ... >&-`, or a job without one."""
    command = f"{shlex.quote(sys.executable)} -m fsid {arguments} >&-"
    ended = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE, text=True)
    assert (ended.returncode, ended.stderr) == (0, "")


@pytest.mark.parametrize("encoding", ["ascii", "utf-8"])
def test_a_name_that_is_no_text_fails_no_command(photos: Path, tmp_path: Path, encoding: str) -> None:
    out = os.path.join(os.fsencode(tmp_path), "trü".encode("latin-1"))
    command = [sys.executable, "-m", "fsid", "generate", out, "--count", "1", "--images", str(photos)]
    environment = {**os.environ, "PYTHONIOENCODING": encoding}
    small = ["--width", "32", "--height", "32"]
    for last in (["--dry-run"], []):
        subprocess.run([*command, *small, *last], check=True, capture_output=True, env=environment)
    assert r"tr\udcfc" in Path(os.fsdecode(out), "README.md").read_text(encoding="utf-8")
    looked_at = [sys.executable, "-m", "fsid", "inspect", out, "--out", out + b".looked-at"]
    subprocess.run(looked_at, check=True, capture_output=True, env=environment)


def test_brackets_in_a_name_are_printed(photos: Path, capsys: pytest.CaptureFixture[str]) -> None:
    small = ["--count", "1", "--images", str(photos), "--width", "32", "--height", "32"]
    cli.main(["generate", "sets[a]/[/b]", *small, "--dry-run", "--quiet"])
    assert capsys.readouterr().out.startswith("sets[a]/[/b]: 1 pair in 1 shard\n")


def test_a_file_that_is_named_in_bytes_is_named_in_letters(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refused() -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), b"run/events")

    monkeypatch.setitem(cli.COMMANDS, "profiles", refused)
    with pytest.raises(SystemExit):
        cli.main(["profiles"])
    assert capsys.readouterr().err == "fsid: run/events: Read-only file system\n"


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def test_rate_and_time_left_are_those_since_the_start() -> None:
    """Shards of sixteen pairs come in bursts, and a run that goes on has many pairs already."""
    clock = Clock()
    pace = Pace(clock)
    pace.update(1000, 1160)
    assert (pace.rate, pace.left) == (0.0, "")
    for clock.now, done in ((40.0, 1016), (40.1, 1032), (80.0, 1048), (80.0, 1064)):
        pace.update(done, 1160)
    assert pace.rate == pytest.approx(0.8)
    lefts = []
    for clock.now in (80.0, 110.0, 999.0):
        lefts.append(pace.left)
    assert lefts == ["0:02:00", "0:01:30", "0:00:00"]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """That of all bars."""
    clock = Clock()
    monkeypatch.setattr(progress, "Pace", lambda: Pace(clock))
    return clock


def test_without_a_terminal_a_line_a_minute_says_how_far_it_is(
    clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    told = ["pairs: 6/20 0.1 pairs/s, 0:02:20 left", "pairs: 12/20 0.1 pairs/s, 0:01:20 left"]
    told.append("pairs: 18/20 0.1 pairs/s, 0:00:20 left")
    for quiet in (False, True):
        with progress.progress_bar("pairs", "pairs", quiet=quiet) as bar:
            for clock.now in range(0, 201, 20):
                bar(int(clock.now // 10), 20)
        lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("pairs: ")]
        assert lines == ([] if quiet else told)


def test_a_bar_gets_shorter_where_its_terminal_is_narrow_and_its_figures_do_not(
    clock: Clock, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    with progress.progress_bar("checking my photographs", "pictures", quiet=False) as bar:
        bar(0, 1000)
        clock.now = 10.0
        bar(999, 1000)
    assert "999/1000 99.9 pictures/s, 0:00:00 left" in capsys.readouterr().err


def test_what_comes_after_has_a_bar_and_a_pace_of_its_own(
    clock: Clock, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for is_reached in (False, True):
        clock.now = 0.0
        with progress.progress_bar("pairs", "pairs", quiet=False) as bar:
            after = bar.then("checking the whole", "shards")
            for clock.now in (0.0, 10.0):
                bar(int(clock.now), 10)
            if is_reached:
                after(0, 8)
                clock.now = 12.0
                after(4, 8)
            assert [task.percentage for task in bar._bar.tasks] == [100, 50 * is_reached]
            assert all(task.started for task in bar._bar.tasks)  # or a bar has no length
        shown = capsys.readouterr().err
        assert "10/10 1 pairs/s, 0:00:00 left" in shown
        assert ("checking the whole" in shown) == is_reached
        assert ("4/8 2 shards/s, 0:00:02 left" in " ".join(shown.split())) == is_reached


@pytest.mark.parametrize("columns", ["30", "50"])
def test_a_narrow_terminal_cuts_no_figure_of_a_table(
    columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    cli.main(["profiles"])
    listed = capsys.readouterr().out
    for name in ("galaxy-s22-plus-front", "Samsung", "GRBG", "1023"):
        assert name in listed
    assert "…" not in listed


@pytest.fixture
def help_of(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """The help of a command, or of all where none is named."""

    def told(*command: str) -> str:
        with pytest.raises(SystemExit):
            cli.main([*command, "--help"])
        return capsys.readouterr().out

    return told


def test_a_help_breaks_lines_where_its_terminal_does(help_of: Callable[..., str]) -> None:
    """And not where the source does."""
    text = help_of("evaluate")
    assert "images.csv (every image) and report.html (tables, plot, before and after, error maps)." in text
    assert "shipped network (nafnet-small); may be given several" in text


@pytest.mark.parametrize(
    "usage",
    [
        "calibrate FRAME...",
        "denoise INPUT OUTPUT",
        "develop INPUT OUTPUT",
        "evaluate TESTSET",
        "export RUN OUTPUT",
        "generate OUT",
        "inspect DATA",
        "preview OUTPUT",
        "profiles [NAME]",
        "scene SEED",
        "testset {photos,simulate,from-bursts} [FOLDER...]",
        "train DATA",
    ],
)
def test_the_usage_names_what_goes_where(usage: str, help_of: Callable[..., str]) -> None:
    """As the README does; all places were called PATH."""
    command, _, places = usage.partition(" ")
    told = " ".join(help_of(command).split())
    assert re.match(rf"usage: fsid {command} \[-h\] (\[[A-Z]+ OPTIONS\] )?{re.escape(places)} ", told)


@pytest.mark.parametrize("command", cli.COMMANDS)
def test_the_help_of_an_option_is_free_of_python(command: str, help_of: Callable[..., str]) -> None:
    """--iso FLOAT, where it was --iso {None}|FLOAT (default: None); switches and empty lists likewise."""
    assert not re.search(r"None|False|default: *\)|default: *''", help_of(command))


def test_the_list_of_commands_has_a_sentence_of_each(help_of: Callable[..., str]) -> None:
    """And their help all the rest, whichever is asked for first."""
    for command, more in ((), False), (("demo",), True), ((), False):
        told = " ".join(help_of(*command).split())
        assert "Render scenes, train a small network" in told
        assert ("Running it again continues it." in told) is more


def test_defaults_that_are_figures_are_told(help_of: Callable[..., str]) -> None:
    text = help_of("preview")
    assert "Number of scenes. (default: 12)" in text
    assert "Seed of the dataset. (default: 0)" in text


@pytest.mark.parametrize("command", ["generate", "preview"])
def test_the_paper_s_names_of_variants_are_in_the_help_alone(
    command: str, help_of: Callable[..., str]
) -> None:
    """No option takes them, so the guide to the settings calls variants what the option calls them."""
    assert "v1 to v4" in " ".join(help_of(command).split())
    guide = Path(__file__).resolve().parents[1] / "docs" / "scenes.md"
    assert not re.search(r"\bv[1-4]\b", guide.read_text(encoding="utf-8"))


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    cli.main(["--version"])
    assert capsys.readouterr().out == f"fsid {__version__}\n"


@pytest.mark.parametrize(
    ("command", "names"),
    [
        ("train data -o run --config nafnet-tony", "nafnet-32, nafnet-64, nafnet-small, nafnet-tiny, paper"),
        ("generate data --count 1 --config fsid-175", "fsid-175k"),
    ],
)
def test_a_configuration_that_is_none_is_refused_with_those_that_are(
    command: str, names: str, tmp_path: Path, monkeypatch, refused: Callable[..., str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert f"is no file and no built-in configuration ({names})" in refused(*command.split())
    assert not any(tmp_path.iterdir())


HOSTILE = "\x1b[31mred\x1b]0;title\x07\x9b1m\nb\rc\x00"


def test_a_refusal_is_one_line_of_text_whatever_it_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        cli.main(["inspect", str(tmp_path / HOSTILE.replace("\0", ""))])
    line = capsys.readouterr().err
    assert line.endswith("photographs\n")
    assert line[:-1].isprintable()
    assert r"\x1b[31mred\x1b]0;title\x07\x9b1m\nb\x0dc" in line


def test_a_terminal_obeys_no_text_but_shows_it():
    """Of cells, of single lines and of the label of a progress bar; styles stay."""
    table = Table("a")
    table.add_row(HOSTILE)
    for thing in (table, Text(HOSTILE), HOSTILE, Progress(TextColumn(HOSTILE, markup=False))):
        if isinstance(thing, Progress):
            thing.add_task("x")
        for colours in (True, False):
            file = io.StringIO()
            Terminal(file=file, markup=False, force_terminal=colours, width=200).print(thing, style="bold")
            printed = file.getvalue()
            assert ("\x1b[1m" in printed) == colours
            text = re.sub(r"\x1b\[[0-9;]*m", "", printed)
            assert r"\x1b[31mred" in text  # a cell has room for what the text was before
            assert text.replace("\n", "").isprintable()


def test_a_strangers_test_set_is_printed_as_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    photos = tmp_path / "photos"
    photos.mkdir()
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (64, 64, 3)).astype(np.uint8)).save(
        photos / "a.png"
    )
    made = tmp_path / "set"
    cli.main(["testset", "photos", str(photos), "-o", str(made), "--iso", "800", "--quiet"])
    file = made / "testset.json"
    content = json.loads(file.read_text())
    content["images"][0]["set"] = HOSTILE
    file.write_text(json.dumps(content))
    capsys.readouterr()
    cli.main(["evaluate", str(made), "--quiet"])
    out = capsys.readouterr().out
    assert r"\x1b[31mred" in out
    assert "\x1b" not in out
