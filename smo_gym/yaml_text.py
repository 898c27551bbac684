"""YAML as settings need it: plain data of a sensible size, each key once, and every number that looks like one."""

from __future__ import annotations

import math
import re
from reprlib import repr as short
from typing import Any

import yaml

MOST_CHARACTERS = 1_000_000
"""Most characters of a file."""
MOST_VALUES = 20_000
"""Most values of a file, with what aliases stand for; a text counts one more for every hundred characters."""
MOST_LEVELS = 32
"""Most levels of values in values."""


class Unsuitable(ValueError):
    """YAML that is more or something else than settings are; the line is named."""


def load(text: str) -> Any:
    """What a YAML text holds.

    Raises:
        Unsuitable: it is more or something else than settings are.
        yaml.YAMLError: it is not YAML; a tag on what is none of its kind gives whatever the library raises.
    """
    return yaml.load(text, _Loader)  # a SafeLoader


class _Loader(yaml.SafeLoader):
    """Plain data. YAML 1.1, with the numbers of YAML 1.2: 3e-4 and 1e6 are numbers, 1:30 and 010 are not others."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._level = 0
        self._values = 0
        self._weights: dict[yaml.Node, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """A value and what is inside of it, counted."""
        event = self.peek_event()  # type: ignore[no-untyped-call]
        alias = isinstance(event, yaml.AliasEvent)
        self._level += 1
        self._values += 1
        if self._level > MOST_LEVELS:
            raise _error(f"nested more than {MOST_LEVELS} levels deep", event)
        if self._values > MOST_VALUES:
            raise _error(f"the file holds more than {MOST_VALUES:,} values", event)
        node = super().compose_node(parent, index)
        self._level -= 1
        if node is None:
            return None
        if alias and node not in self._weights:
            raise _error(f"*{short(event.anchor).strip(chr(39))} stands for what it is inside of", event)
        if not alias:
            self._weights[node] = self._weigh(node)
        if self._weights[node] > MOST_VALUES:
            raise _error(f"the file holds more than {MOST_VALUES:,} values, or too long ones", event)
        return node

    def _weigh(self, node: yaml.Node) -> int:
        if isinstance(node, yaml.ScalarNode):
            return 1 + len(node.value) // 100
        if isinstance(node, yaml.MappingNode):
            keys = set()
            for key, _ in node.value:
                name = (key.tag, key.value) if isinstance(key, yaml.ScalarNode) else key
                if name in keys:
                    raise _error(f"the key {short(key.value)} is given twice", key)
                keys.add(name)
            return 1 + sum(self._weights[child] for pair in node.value for child in pair)
        return 1 + sum(self._weights[child] for child in node.value)

    def construct_number(self, node: yaml.ScalarNode) -> float:
        """A finite number."""
        whole = node.tag == "tag:yaml.org,2002:int"
        value: float = self.construct_yaml_int(node) if whole else self.construct_yaml_float(node)
        if not abs(value) < 1e300 or math.isnan(value):
            raise _error(f"{short(node.value)} is no finite number", node)
        return value


def _error(problem: str, at: Any) -> Unsuitable:
    return Unsuitable(f"line {at.start_mark.line + 1}: {problem}")


_NUMBERS = {
    "int": r"[-+]?(0|[1-9][0-9_]*|0b[01_]+|0x[0-9a-fA-F_]+)",
    "float": r"[-+]?(\.[0-9]+|[0-9][0-9_]*(\.[0-9_]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
}
_TAGS = {name: f"tag:yaml.org,2002:{name}" for name in _NUMBERS}
_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag not in _TAGS.values()]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
for _name, _tag in _TAGS.items():
    _Loader.add_implicit_resolver(_tag, re.compile(rf"^(?:{_NUMBERS[_name]})$"), list("-+0123456789."))
    _Loader.add_constructor(_tag, _Loader.construct_number)
