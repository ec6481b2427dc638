"""`fsid COMMAND ...`: finds the command, and turns bad input into one line and exit code 2."""

from __future__ import annotations

import errno
import io
import logging
import os
import re
import select
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from difflib import get_close_matches
from inspect import cleandoc, signature
from types import FrameType
from typing import NoReturn, TextIO

import tyro
from rich.text import Text

from fsid import __version__
from fsid.cli import (
    calibrate,
    demo,
    denoise,
    develop,
    doctor,
    evaluate,
    experiment,
    export,
    generate,
    inspect,
    preview,
    profiles,
    scene,
    testset,
    train,
)
from fsid.cli.optional import AS_GIVEN, without_empty_defaults
from fsid.errors import FsidError
from fsid.terminal import Terminal, error_line

COMMANDS: dict[str, Callable[..., None]] = {
    "generate": generate.generate,
    "preview": preview.preview,
    "scene": scene.scene,
    "inspect": inspect.inspect,
    "calibrate": calibrate.calibrate,
    "profiles": profiles.profiles,
    "train": train.train,
    "denoise": denoise.denoise,
    "develop": develop.develop,
    "testset": testset.testset,
    "evaluate": evaluate.evaluate,
    "experiment": experiment.experiment,
    "export": export.export,
    "demo": demo.demo,
    "doctor": doctor.doctor,
}

DESCRIPTION = (
    "RAW denoisers trained on nothing but rendered scenes: generate pairs, train, denoise, prove. "
    "fsid COMMAND --help describes a command and its options."
)
RESUMABLE = {"generate", "train", "experiment", "demo"}
FROM_THE_START = {"--dry-run", "--only"}
"""With these `fsid generate` keeps nothing to go on from."""
REPEATABLE = {"--model"}  # of evaluate
OUTPUTS = {"-o", "--out", "--output"}
"""What some commands call their last place."""
ENDING = (signal.SIGTERM, signal.SIGHUP)
"""Of Slurm and `docker stop`, and of a terminal or a connection that is closed."""
FULL = (errno.ENOSPC, errno.EDQUOT)
CLOSED = (errno.EPIPE, errno.EIO)  # what a pipe says without its reader, and a terminal that is gone
SYMLINK_LOOP = "Symlink loop"  # how the RuntimeError of Path.resolve begins
EXTRAS = {
    "torch": "train",
    "accelerate": "train",
    "safetensors": "train",
    "onnx": "onnx",
    "onnxruntime": "onnx",
    "onnxscript": "onnx",
    "ray": "ray",
    "mitsuba": "reference",
}


_received: list[int] = []
"""Signals of ENDING since the command began."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command, in the main thread; exit code 0 when done, 2 for bad input or a full disk, 130 after
    Ctrl-C, 143 after SIGTERM, 129 after SIGHUP, 141 when nobody reads on."""
    _open_closed()
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it warns of its own cache without a home folder
    _received.clear()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a file's name may be no text in its encoding
            stream.reconfigure(errors="backslashreplace")
    heeded = [number for number in ENDING if signal.getsignal(number) != signal.SIG_IGN]  # nohup ignores one
    before = {number: signal.signal(number, _terminate) for number in heeded}
    try:
        try:
            _run(arguments)
        finally:
            sys.stdout.flush()
    except OSError as error:
        is_closed = error.errno in CLOSED and not (_is_read(sys.stdout) and _is_read(sys.stderr))
        if not is_closed and error.errno not in FULL:
            raise
        _silence(sys.stdout)
        if is_closed:
            _silence(sys.stderr)
            sys.exit(141)
        _fail(os.strerror(error.errno or 0))
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _open_closed() -> None:
    """Send to nowhere what is printed on a closed output: neither help nor errors ask whether there is one.

    Each takes the lowest number that is free: a file of the dataset would have it, and what a driver prints.
    """
    if sys.stdin is None:
        sys.stdin = open(os.devnull)  # noqa: SIM115  for as long as the process lives
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115


def _terminate(number: int, frame: FrameType | None) -> None:
    """Cleans up as after Ctrl-C. Ray passes on no exception of a kind of its own, so the number is kept."""
    for ending in ENDING:
        signal.signal(ending, signal.SIG_IGN)  # a second one must not end the cleaning up
    _received.append(number)
    raise KeyboardInterrupt


def _run(arguments: Sequence[str] | None) -> None:
    given = sys.argv[1:] if arguments is None else list(arguments)
    if given == ["--version"]:
        print(f"fsid {__version__}")
        return
    try:
        _check_options(given)
        with _documented(given[:1]):
            tyro.extras.subcommand_cli_from_dict(
                COMMANDS,
                prog="fsid",
                description=DESCRIPTION,
                args=given,
                config=(tyro.conf.FlagCreatePairsOff,),
                registry=AS_GIVEN,
            )
    except FsidError as error:
        _fail(str(error))
    except ModuleNotFoundError as error:
        if error.name not in EXTRAS:
            raise
        _fail(
            f"this command needs {error.name}, which is not installed: "
            f"pip install 'fsid[{EXTRAS[error.name]}]'"
        )
    except OSError as error:
        if error.filename is None:
            raise
        _fail(f"{os.fsdecode(error.filename)}: {error.strerror}")
    except RuntimeError as error:
        if not str(error).startswith(SYMLINK_LOOP):
            raise
        _fail(str(error))
    except KeyboardInterrupt:
        what, code = ("terminated", 128 + _received[0]) if _received else ("interrupted", 130)
        goes_on = RESUMABLE.intersection(given[:1]) and FROM_THE_START.isdisjoint(_options(given))
        hint = "; the same command goes on from what is finished" if goes_on else ""
        _tell(Text(f"fsid: {what}{hint}"))
        sys.exit(code)


@contextmanager
def _documented(asked_for: Sequence[str]) -> Iterator[None]:
    """Inside, commands say what the help shows: all of those asked for, the first line of the others."""
    before = {name: command.__doc__ or "" for name, command in COMMANDS.items()}
    try:
        for name, command in COMMANDS.items():
            document = _flowing(before[name])
            command.__doc__ = document if name in asked_for else document.partition("\n")[0]
            without_empty_defaults(command)
        yield
    finally:
        for name, command in COMMANDS.items():
            command.__doc__ = before[name]


def _flowing(docstring: str) -> str:
    """With every paragraph and every argument on one line: the help breaks lines where its terminal does."""
    return re.sub(r"(?<!\n)\n(?: {8}|(?=\S))", " ", cleandoc(docstring))


def _is_read(stream: TextIO) -> bool:
    """False for a pipe whose other end is closed, as of `fsid ... | head`."""
    try:
        poll = select.poll()
        poll.register(stream.fileno(), 0)
    except (OSError, ValueError):
        return True
    return not poll.poll(0)


def _options(arguments: Sequence[str]) -> list[str]:
    return [
        argument.partition("=")[0].replace("_", "-")
        for argument in arguments
        if argument.startswith("-") and argument.lstrip("-")[:1].isalpha()
    ]


def _check_options(arguments: Sequence[str]) -> None:
    """Refuse an option that its command has not, and one that is given twice.

    Of `--set a=1 --set b=2` the parser would lose the first, and of `--cuont 3 OUT` it would miss OUT.
    """
    names = _options(arguments)
    command = COMMANDS.get(arguments[0]) if arguments else None
    parameters = signature(command).parameters.values() if command else ()
    options = {f"--{p.name.replace('_', '-')}" for p in parameters if p.kind is p.KEYWORD_ONLY}
    places = [p.name.upper() for p in parameters if p.kind is not p.KEYWORD_ONLY]
    known = options | {"-h", "--help"} | ({"-o"} if "--output" in options else set())
    for name in names:
        if command and name not in known:
            near = get_close_matches(name, sorted(known), n=1)
            hint = f"did you mean {near[0]}?" if near else f"see fsid {arguments[0]} --help"
            if name in OUTPUTS and places[-1:] in (["OUT"], ["OUTPUT"]):
                hint = f"it is fsid {arguments[0]} {' '.join(places)}"
            raise FsidError(f"{name}: fsid {arguments[0]} has no such option; {hint}")
        if names.count(name) > 1 and name not in REPEATABLE:
            raise FsidError(f"{name}: is given twice; several values go behind one {name}")


def _fail(line: str) -> NoReturn:
    _tell(error_line(line))
    sys.exit(2)


def _tell(line: Text) -> None:
    """Print `line` on standard error; where that is full or closed, the exit code alone says it."""
    try:
        Terminal(stderr=True).print(line, soft_wrap=True)
    except OSError:
        _silence(sys.stderr)


def _silence(stream: TextIO) -> None:
    """Send what is left in `stream` to nowhere: Python flushes once more at its end."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
