"""The one exception that a user is meant to read.

Whatever is wrong with an input (a missing file, a truncated RAW, an unknown key, a full disk) is raised
as `FsidError` with one line that names the file or key and says what to do. The command line prints that
line and exits with code 2; any other exception is a bug in FSID and keeps its traceback.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any

_NAMED = 5


class FsidError(Exception):
    """Bad input. The message is one complete line for the user: what is wrong, where, what to do."""


def whole(value: Any, name: str) -> int:
    """A whole number as Python's, also one of NumPy's; FsidError, naming it, for 960.0, a text or None."""
    try:
        return int(operator.index(value))
    except TypeError:
        raise FsidError(f"{name}: {value!r:.60} is not a whole number") from None


def check_kind(value: object, kind: type, advice: str) -> None:
    """FsidError unless `value` is a `kind`. advice: how to get one."""
    if not isinstance(value, kind):
        raise FsidError(f"a {type(value).__name__} is no {kind.__name__}: {advice}")


def refuse_any(faults: Sequence[str], of: str) -> None:
    """FsidError that names the first five of `faults`, one line each; nothing where there are none.

    of: what was looked at, "12 pictures".
    """
    if faults:
        more = f" and {len(faults) - _NAMED} more" if len(faults) > _NAMED else ""
        raise FsidError(
            f"{len(faults)} of {of} cannot be used, mend them or move them elsewhere: "
            f"{'; '.join(faults[:_NAMED])}{more}"
        )
