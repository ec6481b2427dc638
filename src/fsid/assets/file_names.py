"""Names of the user's files as text: a scene is JSON, so a name that is no text cannot be in one.

File systems allow any bytes; Python carries those that are not UTF-8 as lone surrogates, which neither a
terminal nor a hash takes. Text that others wrote (a library's licences) may hold some, too.
"""

from __future__ import annotations

PREFIX = "file:"
"""What tells a file of the user, "file:PATH", from a family of FSID in `Object.family`, `Material.family` and
`Sky.source`."""

NOT_TEXT = "its name is not UTF-8 text"
"""Why such a file is not used."""


def shown(text: str) -> str:
    """`text` with lone surrogates as backslash escapes; the same where it has none."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
