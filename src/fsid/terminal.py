"""What is printed: control characters of a file's name or content are shown as \\x1b, not obeyed.

A camera, a licence or a member of a tar may be called by any characters, and a terminal does what those of an
escape sequence say: it clears itself, changes its title, or hides what was printed before.
"""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Iterable
from importlib.util import find_spec
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.text import Text

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
"""All but tab and line feed, C1 among them: U+009B begins a sequence, too."""


class Terminal(Console):
    """rich's console, which styles by sequences of its own. In a notebook rich needs ipywidgets for what
    moves, and warns in place of all that it has to say; without them a notebook is written to as a terminal.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(force_jupyter=None if find_spec("ipywidgets") else False, **options)

    def on_broken_pipe(self) -> None:
        """Raised as what it is, where rich would exit with code 1."""
        raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """As it comes from rich, with what is text made harmless."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(_harmless(segment.text), segment.style)


def error_line(text: object) -> Text:
    """A refusal as it is printed: one line, whatever names it holds."""
    return Text("fsid: " + _harmless(str(text)).replace("\n", "\\n"), style="bold red")


def _harmless(text: str) -> str:
    return _CONTROL.sub(lambda found: f"\\x{ord(found[0]):02x}", text)
