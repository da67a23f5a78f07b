"""YAML as we accept it: one small document of plain values, every one with its line.

A YAML file can name a key twice, blow up through aliases, build Python objects, or read `1e-3` as
text and `010` as 8. Here the parser's events are walked, never a loader's objects; what two YAML
readers would understand differently is an error. Plain scalars follow YAML 1.2's core rules.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from semmap_log.errors import FormatError
from semmap_log.interop.formats.parsing.foreign_file import MIB, decode_utf8, read_capped
from semmap_log.interop.formats.parsing.problems import Problems, shown

MOST_BYTES = 8 * MIB
MOST_NODES = 500_000
"""Some 27,000 doors of the thesis's YAML."""
MOST_DEPTH = 32
MOST_DIGITS = 4_000
"""Python itself refuses to read longer whole numbers."""

ScalarValue: TypeAlias = str | int | float | bool | None


@dataclass(frozen=True, slots=True)
class Scalar:
    """A single value."""

    line: int
    """1-based, like every line here."""
    value: ScalarValue
    text: str
    """As written, without quotes."""


@dataclass(frozen=True, slots=True)
class Sequence:
    """A list of values."""

    line: int
    items: list[Node]


@dataclass(frozen=True, slots=True)
class Mapping:
    """Keys with their values. A key is its text: `1` and `"1"` are the same key."""

    line: int
    entries: dict[str, Node]
    """In the file's order."""
    key_lines: dict[str, int]


Node: TypeAlias = Scalar | Sequence | Mapping


def load_yaml(path: Path, *, takes_nan: bool = False) -> Node:
    """Return the file's one document; an empty file is a Scalar of None.

    Args:
        path: The file.
        takes_nan: `.nan` is a value, which the reader of that place judges; else it is an error.

    Raises:
        FormatError: The file cannot be read, is not YAML, or holds what we do not accept.
    """
    return parse_yaml(read_capped(path, most_bytes=MOST_BYTES), path, takes_nan=takes_nan)


def parse_yaml(data: bytes, path: Path, *, takes_nan: bool = False) -> Node:
    """Return the one document in `data`; `path` is for messages, `takes_nan` as for `load_yaml`.

    Raises:
        FormatError: It is not YAML, or holds what we do not accept.
    """
    return _Builder(decode_utf8(data, path), path, takes_nan=takes_nan).document()


class _Builder:
    """Builds the tree from the parser's events."""

    def __init__(self, text: str, path: Path, *, takes_nan: bool) -> None:
        self.events = _events(text, path)
        self.problems = Problems(path)
        self.takes_nan = takes_nan
        self.nodes = 0

    def document(self) -> Node:
        root: Node = Scalar(1, None, "")
        documents = 0
        for event in self.events:
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise self._refuse(event, "expected one document, got a second one")
            elif not isinstance(
                event, (yaml.StreamStartEvent, yaml.StreamEndEvent, yaml.DocumentEndEvent)
            ):
                root = self.node(event, depth=1)
        self.problems.raise_any()
        return root

    def node(self, event: Any, depth: int) -> Node:
        self.nodes += 1
        if self.nodes > MOST_NODES:
            raise self._refuse(event, f"expected at most {MOST_NODES:,} values")
        if depth > MOST_DEPTH:
            raise self._refuse(event, f"expected at most {MOST_DEPTH} levels of nesting")
        self._reject_tricks(event)
        if isinstance(event, yaml.ScalarEvent):
            return self.scalar(event)
        if isinstance(event, yaml.SequenceStartEvent):
            items = []
            while not isinstance(following := next(self.events), yaml.SequenceEndEvent):
                items.append(self.node(following, depth + 1))
            return Sequence(_line(event), items)
        return self.mapping(event, depth)

    def mapping(self, start: Any, depth: int) -> Mapping:
        entries: dict[str, Node] = {}
        key_lines: dict[str, int] = {}
        while not isinstance(event := next(self.events), yaml.MappingEndEvent):
            key = self.node(event, depth + 1)
            value = self.node(next(self.events), depth + 1)
            if not isinstance(key, Scalar):
                self.problems.add(key.line, "expected a key that is a single value")
            elif key.text == "<<" and event.implicit[0]:
                self.problems.add(key.line, "merge keys (<<) are not read: write the values out")
            elif key.text in entries:
                first = key_lines[key.text]
                self.problems.add(
                    key.line,
                    f"key {shown(key.text)} is there twice: first on line "
                    f"{first}; keep one of them",
                )
            else:
                entries[key.text] = value
                key_lines[key.text] = key.line
        return Mapping(_line(start), entries, key_lines)

    def scalar(self, event: Any) -> Scalar:
        plain = event.implicit[0]
        if plain and self.takes_nan and event.value in _NANS:
            return Scalar(_line(event), math.nan, event.value)
        try:
            value = resolve(event.value) if plain else event.value
        except ValueError as error:
            self.problems.add(_line(event), str(error))
            value = None
        return Scalar(_line(event), value, event.value)

    def _reject_tricks(self, event: Any) -> None:
        if isinstance(event, yaml.AliasEvent) or event.anchor is not None:
            raise self._refuse(
                event,
                "anchors and aliases (& and *) are not read: "
                "write the values out, or quote the text",
            )
        if event.tag is not None:
            raise self._refuse(
                event, f"tags ({shown(event.tag)}) are not read: leave it out, or quote the text"
            )

    def _refuse(self, event: Any, text: str) -> FormatError:
        """Return an error that ends the reading: there may be no end of such problems."""
        return self.problems.with_last(_line(event), text)


def _events(text: str, path: Path) -> Iterator[Any]:
    """Yield the parser's events one by one, so that a bomb is met before it is unpacked."""
    loader = yaml.CSafeLoader if yaml.__with_libyaml__ else yaml.SafeLoader
    try:
        yield from yaml.parse(text, loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else 1
        raise FormatError(path, [(line, f"not YAML: {error.problem or error.context}")]) from None
    except yaml.reader.ReaderError as error:
        line = text.encode().count(b"\n", 0, error.position) + 1
        problem = f"not YAML: character #x{error.character:04x} is not allowed"
        raise FormatError(path, [(line, problem)]) from None
    except yaml.YAMLError as error:
        raise FormatError(path, f"not YAML: {error}") from None


def _line(event: Any) -> int:
    line: int = event.start_mark.line
    return line + 1


_NULLS = frozenset({"", "~", "null", "Null", "NULL"})
_BOOLS = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_WHOLE = re.compile(r"[-+]?(0|[1-9][0-9]*)")
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+\.[0-9]*|[0-9]+(?=[eE]))([eE][-+]?[0-9]+)?")
_NANS = (".nan", ".NaN", ".NAN")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")


def not_finite(text: str) -> str:
    """Return the message about a text that is not a number."""
    return f"expected a finite number, got {text}: where a value is not known, leave its key out"


def resolve(text: str) -> ScalarValue:
    """Return what an unquoted scalar means.

    `010`, `0x1F`, `1:30`, `2001-01-01`, `yes` stay text: readers disagree about them, and where a
    number is expected the reader of that place says so.

    Raises:
        ValueError: Not a finite number, or one too long to read.
    """
    if text in _NULLS:
        return None
    if text in _BOOLS:
        return _BOOLS[text]
    if text[0] not in "-+.0123456789":
        return text
    if _WHOLE.fullmatch(text):
        if len(text) > MOST_DIGITS:
            raise ValueError(f"expected a number of at most {MOST_DIGITS} digits, got {len(text)}")
        return int(text)
    if _NOT_FINITE.fullmatch(text):
        raise ValueError(not_finite(text))
    if _NUMBER.fullmatch(text):
        value = float(text)
        if not math.isfinite(value):
            raise ValueError(f"expected a number below 1.8e308, got {shown(text)}")
        return value
    return text
