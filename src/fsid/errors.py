"""The one exception that a user is meant to read.

Whatever is wrong with an input (a missing file, a truncated RAW, an unknown key, a full disk) is raised
as `FsidError` with one line that names the file or key and says what to do. The command line prints that
line and exits with code 2; any other exception is a bug in FSID and keeps its traceback.
"""

from __future__ import annotations

from collections.abc import Sequence

_NAMED = 5


class FsidError(Exception):
    """Bad input. The message is one complete line for the user: what is wrong, where, what to do."""


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
