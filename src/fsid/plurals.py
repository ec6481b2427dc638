"""How many of what, in the words of messages: "1 pair", "2 pairs"."""

from __future__ import annotations


def counted(count: int, one: str) -> str:
    """`count` things, each called `one`: the plural of all but "1"."""
    return f"{count} {one}" if count == 1 else f"{count} {one}{'es' if one.endswith('sh') else 's'}"
