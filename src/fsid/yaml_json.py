"""YAML and JSON as plain values, loaded safely: a file may come from anywhere.

A key that a YAML text gives twice is an error, and so are a whole number that begins with a zero and aliases
that stand for more than memory holds.
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import yaml

from fsid.errors import FsidError
from fsid.files import read_whole

_MOST_NODES = 1_000_000
"""Values of a YAML text: aliases of aliases stand for more than any memory holds."""


def read_yaml(file: Path) -> dict[str, Any]:
    """A YAML mapping, loaded safely; FsidError where it is missing, broken or something else."""
    try:
        text = read_whole(file).decode()
    except UnicodeDecodeError as error:
        raise FsidError(f"{file}: is not valid YAML ({error})") from None
    plain = parse_yaml(text, str(file))
    if plain is None:
        return {}
    if not isinstance(plain, dict):
        raise FsidError(f"{file}: expected 'key: value' lines, found {type(plain).__name__}")
    return plain


def parse_yaml(text: str, source: str) -> Any:
    """What a YAML text holds, loaded safely; FsidError, naming `source`, where it is broken.

    A key that is given twice is refused, too.
    """
    try:
        return yaml.load(text, _Loader)
    except (yaml.YAMLError, ValueError) as error:
        reason = " ".join(str(error).split())
    except Exception:  # PyYAML lets through whatever int(), datetime, a dict or the stack raise
        reason = "a value is not of the type that it states, or nested too deeply"
    raise FsidError(f"{source}: is not valid YAML ({reason})")


def read_json(file: Path) -> Any:
    """What a JSON file holds; FsidError where it is missing or broken."""
    return parse_json(read_whole(file), str(file))


def parse_json(data: bytes | str, source: str) -> Any:
    """What JSON, as text or in UTF-8, 16 or 32, holds; FsidError, naming `source`, where it is broken."""
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        raise FsidError(f"{source}: is not valid JSON ({error})") from None


class _Loader(yaml.SafeLoader):
    _composed = 0

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        """YAML 1.1 takes 010 for 8, and nobody means that; YAML 1.2 takes it for 10."""
        if re.fullmatch(r"[-+]?0[0-9_]+", node.value):
            problem = f"{node.value} begins with a zero; write the number without, a text in quotes"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)
        return super().construct_yaml_int(node)

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        self._composed += 1
        if self._composed > _MOST_NODES:  # which take about a kilobyte each
            raise yaml.YAMLError(f"it has more than {_MOST_NODES:,} values")
        return super().compose_node(parent, index)

    def get_single_node(self) -> yaml.Node | None:
        node = super().get_single_node()
        if node is not None and _nodes(node, {}) > _MOST_NODES:
            raise yaml.YAMLError("its aliases stand for too many values, or for themselves")
        return node

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        node = super().compose_mapping_node(anchor)
        seen = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if (key.tag, key.value) in seen:
                    raise yaml.MarkedYAMLError(
                        problem=f"{key.value} is given twice", problem_mark=key.start_mark
                    )
                seen.add((key.tag, key.value))
        return node


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_yaml_int)


def _nodes(node: yaml.Node, known: dict[int, float]) -> float:
    """How many values there are with every alias written out; infinite where one holds itself."""
    if isinstance(node, yaml.ScalarNode):
        return 1
    if id(node) not in known:
        known[id(node)] = math.inf
        pairs = node.value if isinstance(node, yaml.MappingNode) else [node.value]
        known[id(node)] = 1 + sum(_nodes(item, known) for items in pairs for item in items)
    return known[id(node)]
