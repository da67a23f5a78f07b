"""Typed values out of a strict YAML tree: what is missing or wrong is noted, not raised at once.

The functions return None after noting what was expected there and what was got. `Fields` returns
a placeholder instead: once `problems.raise_any()` has passed, every value it gave is real.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from semmap_log.interop.formats.parsing import strict_yaml
from semmap_log.interop.formats.parsing.problems import Problems, shown

_LEADING_ZERO = re.compile(r"[-+]?0[0-9]+")


def mapping_of(node: strict_yaml.Node, what: str, problems: Problems) -> strict_yaml.Mapping | None:
    """Return the node as keys and values."""
    if isinstance(node, strict_yaml.Mapping):
        return node
    problems.add(node.line, f"{what}: expected keys and values, got {described(node)}")
    return None


def sequence_of(
    node: strict_yaml.Node, what: str, problems: Problems
) -> strict_yaml.Sequence | None:
    """Return the node as a list."""
    if isinstance(node, strict_yaml.Sequence):
        return node
    problems.add(node.line, f"{what}: expected a list, got {described(node)}")
    return None


def number_of(node: strict_yaml.Node, what: str, problems: Problems) -> float | None:
    """Return the node as a finite number."""
    value = node.value if isinstance(node, strict_yaml.Scalar) else None
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if math.isnan(value):
            problems.add(node.line, f"{what}: {strict_yaml.not_finite(described(node))}")
            return None
        try:
            return float(value)
        except OverflowError:
            problems.add(node.line, f"{what}: expected a number below 1.8e308, got a larger one")
            return None
    problems.add(node.line, f"{what}: expected a number, got {described(node)}")
    return None


def whole_of(node: strict_yaml.Node, what: str, problems: Problems) -> int | None:
    """Return the node as a whole number."""
    value = node.value if isinstance(node, strict_yaml.Scalar) else None
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    problems.add(node.line, f"{what}: expected a whole number, got {described(node)}")
    return None


def text_of(node: strict_yaml.Node, what: str, problems: Problems) -> str | None:
    """Return the node's text; a number's is as it was written."""
    if isinstance(node, strict_yaml.Scalar) and node.value is not None:
        return node.text
    problems.add(node.line, f"{what}: expected a text, got {described(node)}")
    return None


def described(node: strict_yaml.Node) -> str:
    """Return what the node is, for a message."""
    match node:
        case strict_yaml.Mapping():
            return "keys and values"
        case strict_yaml.Sequence():
            return "a list"
        case strict_yaml.Scalar(value=None):
            return "nothing"
        case strict_yaml.Scalar(value=str(), text=text) if _LEADING_ZERO.fullmatch(text):
            return f"{shown(text)} (some readers take a leading zero for octal: write it without)"
        case _:
            return shown(node.text)


@dataclass(frozen=True, slots=True)
class Fields:
    """The values of a mapping by key. A wrong or missing one is noted and gives a placeholder."""

    what: str
    """What the mapping is, for messages."""
    mapping: strict_yaml.Mapping
    problems: Problems

    def node(self, key: str) -> strict_yaml.Node | None:
        """Return the key's node; None, and noted, where it is missing."""
        found = self.mapping.entries.get(key)
        if found is None:
            self.problems.add(self.mapping.line, f"{self.what}: expected the key {key}, got none")
        return found

    def number(self, key: str) -> float:
        """Return a finite number; NaN where there is none."""
        node = self.node(key)
        value = number_of(node, f"{self.what}: {key}", self.problems) if node else None
        return math.nan if value is None else value

    def text(self, key: str) -> str:
        """Return a text; empty where there is none."""
        node = self.node(key)
        return (text_of(node, f"{self.what}: {key}", self.problems) or "") if node else ""

    def numbers(self, key: str, names: str) -> tuple[float, ...]:
        """Return a list of as many numbers as there are words in `names`."""
        node = self.node(key)
        found = sequence_of(node, f"{self.what}: {key}", self.problems) if node else None
        count = len(names.split())
        if found is not None and len(found.items) == count:
            values = [number_of(item, f"{self.what}: {key}", self.problems) for item in found.items]
            return tuple(math.nan if value is None else value for value in values)
        if found is not None:
            self.problems.add(
                found.line, f"{self.what}: {key}: expected [{names}], got {len(found.items)} values"
            )
        return (math.nan,) * count

    def refuse(self, key: str, expected: str) -> None:
        """Note that the value of a key that is there is not what was expected."""
        node = self.mapping.entries[key]
        self.problems.add(
            node.line, f"{self.what}: {key}: expected {expected}, got {described(node)}"
        )

    def others(self, known: tuple[str, ...]) -> dict[str, strict_yaml.Node]:
        """Return the keys that are none of the known, with their values."""
        return {key: node for key, node in self.mapping.entries.items() if key not in known}

    def check_known_keys(self, known: tuple[str, ...]) -> None:
        """Note each key that is not one of the known."""
        for key in self.others(known):
            self.problems.add(
                self.mapping.key_lines[key],
                f"{self.what}: expected only the keys {', '.join(known)}; got {shown(key)}",
            )
