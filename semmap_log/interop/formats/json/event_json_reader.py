"""Reading what `event_json` writes, and what people and programs write by hand like it."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from semmap_log.core.model import events
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import NAN, DoorId, DoorState
from semmap_log.core.model.meaning import PART_OF, PARTS, Changed, changed
from semmap_log.core.model.moments import both_instants, parse_instant, zone
from semmap_log.core.model.rules import Nanoseconds, OneOf, Rule, Text, Truth, Whole, text_expected
from semmap_log.errors import FormatError, SemmapError
from semmap_log.interop.formats.json import door_json
from semmap_log.interop.formats.parsing.foreign_file import FileOrder
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.interop.formats.parsing.strict_json import StrictJsonError, load_object


@dataclass(frozen=True, slots=True)
class DoorLookup:
    """What a line may ask about the doors there are. Each may raise a SemmapError."""

    resolve: Callable[[str], DoorId]
    """The door of that name, or level/name."""
    next_id: Callable[[], DoorId]
    """The id for a DoorAdded without one."""
    level_of: Callable[[DoorId], int]
    """The door's level: where a new position without a level lies."""
    level: Callable[[str | None], int]
    """The level of that name; None: the default level."""


@dataclass(frozen=True, slots=True)
class ParsedLine:
    """An event with its note and its times."""

    event: events.Event
    note: Note = field(default_factory=Note)
    """Who and why."""
    command_id: bytes | None = None
    """16 bytes."""
    number: int | None = None
    """Its number in the log that it was exported from."""
    recorded_ns: int | None = None
    """When that log recorded it."""
    commit: tuple[int, int] | None = None
    """First and last event number of its commit there, where that had several."""
    content: bytes | None = None
    """Digest of that command's content, 16 bytes."""
    retracted: bool = False
    """That log had taken it back."""
    timezone: str = ""
    """IANA zone of that log; empty: the line does not have it."""

    @property
    def is_exported(self) -> bool:
        """Whether a log wrote the line, with its commit."""
        return self.number is not None and self.command_id is not None

    @property
    def own_command_id(self) -> bytes | None:
        """The id of a commit that has only this line, 16 bytes; None: it says none."""
        return _own_id(self.command_id, self.number if self.commit else None)


def parse_event_line(
    text: str | bytes, *, lookup: DoorLookup, order: FileOrder, path: Path | str = "line",
    line: int = 1,
) -> ParsedLine:  # fmt: skip
    """Return the event that a line of JSON holds.

    Args:
        text: One JSON object.
        order: The times of the lines before it, and the zone of those without an offset.
        lookup: Finds doors named by `"door"`, and ids for new ones.
        path: For messages.
        line: For messages, 1-based.

    Raises:
        FormatError: Not JSON, not such an event, or `lookup` does not know the door.
    """
    try:
        return _LineReader(load_object(text), order, lookup).line()
    except (SemmapError, StrictJsonError, _WrongError) as error:
        raise FormatError(path, [(line, str(error))]) from None


def command_id_of(text: str | bytes, *, path: Path | str = "line", line: int = 1) -> bytes | None:
    """Return the id of the command that a line of JSON is by itself; None: it has none.

    Of lines that were one commit where they were exported, each is a command of its own.

    Raises:
        FormatError: Not JSON, or not a command id.
    """
    key = "command_id" if isinstance(text, str) else b"command_id"
    if key not in text:  # type: ignore[operator]  # nearly every line: no need to read it twice
        return None
    try:
        values = load_object(text)
        number = values.get("event") if "commit" in values else None
        return _own_id(_hex_id(values.get("command_id")), number)
    except (StrictJsonError, _WrongError) as error:
        raise FormatError(path, [(line, str(error))]) from None


class _WrongError(ValueError):
    """A line that is not an event; gets its file and line from `parse_event_line`."""


class _LineReader:
    """Takes the keys of one object, each once; what is left over at the end is unknown."""

    def __init__(self, values: dict[str, Any], order: FileOrder, lookup: DoorLookup) -> None:
        self.left = dict(values)
        self.order = order
        self.lookup = lookup

    def line(self) -> ParsedLine:
        kind = self.kind()
        self.check_kind_keys(kind)
        happened_ns = self.happened()
        note = self.note()
        command_id = self.command_id()
        number = self.whole("event") if "event" in self.left else None
        recorded_ns = self.instant("recorded")
        commit = self.commit(number)
        content = _hex_id(self.left.pop("content", None), "content")
        retracted = self.truth("retracted") if "retracted" in self.left else False
        timezone = self.text("timezone") if "timezone" in self.left else ""
        if timezone:
            zone(timezone)  # or it is none
        if commit is not None and command_id is None:
            raise _WrongError("commit: expected a command_id with it, got none")
        values = self.floor_map() if kind is events.FloorMap else self.fields(kind)
        assert not self.left, "a key that is known is taken"
        event = kind(happened_ns=happened_ns, **values)
        return ParsedLine(
            event,
            note,
            command_id=command_id,
            number=number,
            recorded_ns=recorded_ns,
            commit=commit,
            content=content,
            retracted=retracted,
            timezone=timezone,
        )

    def note(self) -> Note:
        """Return who and why."""
        if self.left.keys().isdisjoint(door_json.NOTE_KEYS):
            return _EMPTY_NOTE
        texts = (self.text(key) if key in self.left else "" for key in door_json.NOTE_KEYS)
        actor, source, reason, correlation = texts
        note = Note(actor, source, reason, correlation)
        note.check_length()
        return note

    def kind(self) -> type[events.Event]:
        name = self.left.pop("kind", None)
        if isinstance(name, str) and name in events.KIND_BY_NAME:
            return events.KIND_BY_NAME[name]
        from difflib import get_close_matches

        close = get_close_matches(str(name)[:60], events.KIND_BY_NAME, n=1)
        expected = close[0] if close else f"one of {', '.join(events.KIND_BY_NAME)}"
        raise _WrongError(f"kind: expected {expected}; got {shown(name)}")

    def check_kind_keys(self, kind: type[events.Event]) -> None:
        """Name a key that the kind does not have, before one is missed that may be meant by it.

        Raises:
            _WrongError: There is one.
        """
        unknown = next((key for key in self.left if key not in _KNOWN_KEYS[kind]), None)
        if unknown is None:
            return
        known = ["happened", *keys_of(kind)]
        close = get_close_matches(unknown, known, n=1, cutoff=0.7)
        meant = f" (did you mean {close[0]}?)" if close else ""
        raise _WrongError(
            f"unknown key {shown(unknown)}{meant}: {kind.__name__} has the keys {', '.join(known)}"
        )

    def fields(self, kind: type[events.Event]) -> dict[str, Any]:
        values: dict[str, Any] = {}
        if issubclass(kind, events.DoorEvent):
            values["door_id"] = self.door_id(kind)
        if kind is events.DoorUpdated:
            values["changed"] = self.changed()
            if Changed.POSE in values["changed"] and "level" not in self.left:
                values["level"] = self.lookup.level_of(values["door_id"])
        if kind in _MAY_LACK_LEVEL and "level" not in values:
            values |= self.level(kind)
        if kind is events.DoorObserved and "accuracy" in self.left:
            if {"accuracy_open", "accuracy_closed"} & set(self.left):
                raise _WrongError(
                    "accuracy: expected it alone, as it means both accuracy_open and "
                    "accuracy_closed; leave one form out"
                )
            values["accuracy_open"] = values["accuracy_closed"] = self.number("accuracy")
        for name, key, read in _FIELDS[kind]:
            if key in self.left:
                values[name] = read(self, key)
        missing = [key for key, name in _REQUIRED[kind] if name not in values]
        if missing:
            raise _WrongError(f"{kind.__name__}: expected the key {missing[0]}, got none")
        return values

    def level(self, kind: type[events.Event]) -> dict[str, int]:
        """Return the level: by number, by name, or the default."""
        if isinstance(self.left.get("level"), str):
            return {"level": self.lookup.level(self.text("level"))}
        if "level" in self.left:
            return {"level": self.whole("level")}
        return {} if kind is events.DoorUpdated else {"level": self.lookup.level(None)}

    def door_id(self, kind: type[events.Event]) -> DoorId:
        if "door_id" in self.left:
            if "door" in self.left:
                raise _WrongError("door: expected it or door_id, got both")
            return DoorId(self.whole("door_id"))
        if kind is events.DoorAdded and "door" not in self.left:
            return self.lookup.next_id()
        if kind is not events.DoorAdded and "door" in self.left:
            named = self.left["door"]
            if isinstance(named, int) and not isinstance(named, bool):
                raise _WrongError(
                    f"door: expected a name, or level/name, as text, got {named}; write an id as "
                    f'"door_id": {named}'
                )
            return self.lookup.resolve(self.text("door"))
        expected = (
            "door_id, or none for the next free one"
            if kind is events.DoorAdded
            else ("door_id, or door with a name")
        )
        raise _WrongError(f"{kind.__name__}: expected {expected}")

    def changed(self) -> Changed:
        """Return which fields are there; a key `changed` must say the same."""
        there = changed(self.left.keys())
        if Changed.POSE in there and not {"x", "y", "theta"} <= {*self.left}:
            raise _WrongError(
                "expected x, y and theta together (and level with them), got only some of them"
            )
        if not there:
            others = ", ".join(name for name, part in PART_OF.items() if part != Changed.POSE)
            raise _WrongError(
                f"DoorUpdated: expected at least one of x, y, theta (together), {others}; got none"
            )
        said = self.left.pop("changed", None)
        names = [part.name for part in PARTS if part & there]
        if said is not None and (
            not isinstance(said, list) or sorted(map(str, said)) != sorted(map(str, names))
        ):
            raise _WrongError(f"changed: expected {names} as the other keys say, got {shown(said)}")
        return there

    def floor_map(self) -> dict[str, Any]:
        may_lack = ("level", "origin_theta")
        missing = [key for key in door_json.FLOOR_MAP_KEYS if key not in {*self.left, *may_lack}]
        if missing:
            raise _WrongError(f"FloorMap: expected the key {missing[0]}, got none")
        numbers: dict[str, Any] = {
            key: self.number(key)
            for key in door_json.FLOOR_MAP_KEYS
            if key.startswith(("resolution", "origin")) and key in self.left
        }
        numbers |= self.level(events.FloorMap)
        width, height = (self.whole(key) for key in ("width", "height"))
        try:
            cells = door_json.unpack_cells(
                self.text("cells_zlib_base64"), width=width, height=height
            )
        except ValueError as error:
            raise _WrongError(f"cells_zlib_base64: {error}") from None
        return {"cells": cells, **numbers}

    # One value each

    def number(self, key: str) -> float:
        value = self.left.pop(key)
        if value is None:
            return NAN
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise _WrongError(f"{key}: expected a number or null, got {shown(value)}")
        try:
            return float(value)
        except OverflowError:
            raise _WrongError(f"{key}: expected a number below 1.8e308") from None

    def whole(self, key: str) -> int:
        value = self.left.pop(key)
        if isinstance(value, bool) or not isinstance(value, int):
            raise _WrongError(f"{key}: expected a whole number, got {shown(value)}")
        return value

    def text(self, key: str) -> str:
        value = self.left.pop(key)
        if not isinstance(value, str):
            raise _WrongError(f"{key}: expected a text, got {shown(value)}")
        expected = text_expected(value)
        if expected:
            raise _WrongError(f"{key}: expected {expected}, got {shown(value)}")
        return value

    def truth(self, key: str) -> bool:
        value = self.left.pop(key)
        if not isinstance(value, bool):
            raise _WrongError(f"{key}: expected true or false, got {shown(value)}")
        return value

    def state(self, key: str) -> DoorState:
        try:
            return DoorState.parse(self.text(key))
        except ValueError as error:
            raise _WrongError(f"{key}: {error}") from None

    def happened(self) -> int | None:
        """Return when it happened; in the hour that comes twice the lines before it decide."""
        value = self.left.get("happened")
        if not isinstance(value, str):
            return self.instant("happened")
        del self.left["happened"]
        return self.order.chosen(*both_instants(value.strip(), tz=self.order.tz))

    def instant(self, key: str) -> int | None:
        value = self.left.pop(key, None)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, (str, int, float)):
            raise _WrongError(
                f"{key}: expected a time as ISO-8601 text or a number, got {shown(value)}"
            )
        return parse_instant(value, tz=self.order.tz)

    def command_id(self) -> bytes | None:
        return _hex_id(self.left.pop("command_id", None))

    def commit(self, number: int | None) -> tuple[int, int] | None:
        """Return first and last event number of the line's commit; the line's own lies in it."""
        value = self.left.pop("commit", None)
        if value is None:
            return None
        if not (isinstance(value, list) and [type(n) for n in value] == [int, int]):
            raise _WrongError(
                f"commit: expected the numbers of its first and last event, got {shown(value)}"
            )
        first, last = value
        if number is None or not 0 <= first <= number <= last <= events.MAX_EVENT:
            raise _WrongError(
                f"commit: expected event numbers around the line's own, {number}; got {value}"
            )
        return first, last


def _hex_id(value: Any, key: str = "command_id") -> bytes | None:
    if value is None:
        return None
    if not isinstance(value, str) or len(value) != 32 or set(value) - _HEX_DIGITS:
        raise _WrongError(f"{key}: expected 32 hexadecimal digits, got {shown(value)}")
    return bytes.fromhex(value)


def _own_id(command_id: bytes | None, number: object) -> bytes | None:
    """Return the id of one line of a commit; `number` None: the line is all of it."""
    if command_id is None or number is None:
        return command_id
    return hashlib.sha256(command_id + str(number).encode()).digest()[: len(command_id)]


_EMPTY_NOTE = Note()

_OF_EXPORTS = ("event", "recorded", "commit", "content", "retracted", "timezone")
"""Keys by which `import` makes the same log again."""

_HEX_DIGITS = frozenset("0123456789abcdefABCDEF")


def required_keys(kind: type[events.Event]) -> list[tuple[str, str]]:
    """Return (key, field) of each field of the kind that has no default."""
    defaults = events.defaults_of(kind)
    fields = kind.rules.fields.items()
    return [(door_json.key_of(name, rule), name) for name, rule in fields if name not in defaults]


def keys_of(kind: type[events.Event]) -> list[str]:
    """Return the keys that a line of the kind may have, besides `kind` and `happened`."""
    if kind is events.FloorMap:
        return [*door_json.FLOOR_MAP_KEYS, *door_json.NOTE_KEYS, "command_id"]
    names = [door_json.key_of(name, kind.rules.fields[name]) for name in events.public_fields(kind)]
    names += ["accuracy"] if kind is events.DoorObserved else []
    names += ["door"] if issubclass(kind, events.DoorEvent) and kind is not events.DoorAdded else []
    return [*names, *door_json.NOTE_KEYS, "command_id"]


_KNOWN_KEYS = {
    kind: frozenset(
        {"happened", *keys_of(kind), *_OF_EXPORTS, *(["door"] * issubclass(kind, events.DoorEvent))}
    )
    for kind in events.KIND_BY_NAME.values()
}
"""The keys that are read; a `door` in a DoorAdded has a message of its own."""

_READ: Mapping[type[Rule], Callable[[_LineReader, str], Any]] = {
    OneOf: _LineReader.state,
    Nanoseconds: _LineReader.instant,
    Truth: _LineReader.truth,
    Text: _LineReader.text,
    Whole: _LineReader.whole,
}
"""Rule of a field -> what reads its value; all others are numbers."""

_FIELDS = {
    kind: [
        (name, door_json.key_of(name, rule), _READ.get(type(rule), _LineReader.number))
        for name, rule in kind.rules.fields.items()
        if name in events.public_fields(kind)
    ]
    for kind in events.KIND_BY_NAME.values()
}
"""Kind -> its fields, their keys, and what reads their values."""

_REQUIRED = {kind: required_keys(kind) for kind in events.KIND_BY_NAME.values()}
_MAY_LACK_LEVEL = frozenset(
    kind for kind in events.KIND_BY_NAME.values() if events.may_lack_level(kind)
)
