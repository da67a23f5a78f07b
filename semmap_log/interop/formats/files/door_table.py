"""The contents of a file of doors, whatever its format: values with their lines, for `importing`.

A `TableForm` describes the files of other systems: their columns, words, units and lines.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from semmap_log.core.model.doors import NAN, DoorId, DoorState, Level
from semmap_log.core.model.events import FloorMap
from semmap_log.errors import CommandError
from semmap_log.interop.formats.parsing.problems import shown


@dataclass(frozen=True, slots=True)
class TableDoor:
    """A door as a file describes it."""

    line: int
    """Where in the file, 1-based."""
    door_id: DoorId | None
    """None: the format has no numbers; its name and level say which door it is."""
    level: int
    """The number of one of the table's levels; 0 where the format has none."""
    x: float
    y: float
    theta: float
    width: float
    state: DoorState | None = None
    """None: the file does not say."""
    prob_open: float = NAN
    """NaN: the file does not say."""
    prob_closed: float = NAN
    annotations: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TablePlace:
    """A point of a level that has a name."""

    name: str
    level: int
    x: float
    y: float


@dataclass(frozen=True, slots=True)
class DoorTable:
    """All that was read from a file of doors."""

    path: Path
    doors: tuple[TableDoor, ...]
    levels: tuple[Level, ...] = ()
    """Numbered from 1 on, lowest first; the log may number them otherwise."""
    floor_maps: tuple[FloorMap, ...] = ()
    left_out: tuple[str, ...] = ()
    """What the file holds and the log cannot, in words."""
    warnings: tuple[str, ...] = ()
    """What was read, but perhaps not as meant."""
    places: tuple[TablePlace, ...] = ()
    """Points with names: what rooms are called in which they lie."""


TimeUnit = Literal["s", "ms", "us", "ns"]
DIGITS: Mapping[str, int] = MappingProxyType({"s": 0, "ms": 3, "us": 6, "ns": 9})
"""Unit of numbers since 1970 -> how many digits follow the second."""
COLUMNS = ("time", "door", "state", "accuracy")
OURS: Mapping[str, str] = MappingProxyType(
    {"time": "timestamp", "door": "door", "state": "state", "accuracy": "accuracy"}
)
"""What the columns are called in our own form."""


@dataclass(frozen=True, slots=True)
class TableForm:
    """How a file of another system is read as a door CSV."""

    columns: Mapping[str, str] = field(default_factory=lambda: OURS)
    """time, door, state and perhaps accuracy -> what the file calls them."""
    states: Mapping[str, DoorState] = field(default_factory=lambda: MappingProxyType({}))
    """The file's word in small letters -> what it means; others are words of ours."""
    only: tuple[str, ...] = ()
    """Patterns of the doors that are read, as `binary_sensor.*door*`; none: all."""
    unit: TimeUnit | None = None
    """Of times that are numbers since 1970; None: there are none but `@n`."""
    line: Callable[[str], tuple[str, str, str] | None] | None = None
    """Takes time, door and state out of a line; None: a table with a header."""
    reports_changes: bool = False
    """Its rows are changes that a sensor at the door reports: each state holds until the next."""

    def takes(self, door: str) -> bool:
        """Return whether a door is one of those that are read."""
        return not self.only or any(fnmatchcase(door, pattern) for pattern in self.only)

    def state(self, text: str) -> str:
        """Return a state in words of ours; what is no known word is left as it is."""
        word = text.strip().lower()
        found = self.states.get(word, COMMON.get(word))
        return text if found is None else found.name


COMMON: Mapping[str, DoorState] = MappingProxyType({
    "opening": DoorState.MOVING, "closing": DoorState.MOVING, "unavailable": DoorState.OFFLINE,
    "none": DoorState.UNKNOWN, "": DoorState.UNKNOWN,
})  # fmt: skip
"""Words that mean the same in every form, unless it says otherwise."""
_DAY_AND_TIME = r"\d{4}-\d\d-\d\d[T \t]+\d\d:\d\d:\d\d(?:[.,]\d{1,9})?"
_TIME = re.compile(rf"{_DAY_AND_TIME}(?:Z|[+-]\d\d:?\d\d)?")
_CONTACT = re.compile(r'"(?:garage_door_)?contact"\s*:\s*(true|false)\b')
_CASAS = re.compile(rf"\s*({_DAY_AND_TIME})\s+(\S+)\s+(\S+)")


def zigbee2mqtt_line(text: str) -> tuple[str, str, str] | None:
    """Return time, door and state of the message in a line; None: it has none.

    Lines of its log file, as `… MQTT publish: topic 'zigbee2mqtt/gate', payload '{…}'`, and of
    `mosquitto_sub -F '%I %t %p'`: `… zigbee2mqtt/gate {…}`.
    """
    head, _, payload = text.partition("{")
    at, contact = _TIME.search(head), _CONTACT.search(payload)
    _, topic, name = head.rpartition("zigbee2mqtt/")
    if at is None or contact is None or not topic:
        return None
    return at[0], name.partition("', payload")[0].strip(), contact[1]


def casas_line(text: str) -> tuple[str, str, str] | None:
    """Return time, sensor and value of a line; None: it has not these."""
    found = _CASAS.match(text)
    return None if found is None else (found[1], found[2], found[3])


PRESETS: Mapping[str, TableForm] = MappingProxyType({
    # "Download data" of the history panel: entity_id,state,last_changed; UTC with a Z.
    "home-assistant": TableForm(
        columns={"time": "last_changed", "door": "entity_id", "state": "state"},
        states={"on": DoorState.OPEN, "off": DoorState.CLOSED},
        only=("binary_sensor.*", "cover.*"),
        reports_changes=True,
    ),
    # The messages of contact sensors: a contact that is made is a door that is shut.
    "zigbee2mqtt": TableForm(
        states={"true": DoorState.CLOSED, "false": DoorState.OPEN},
        line=zigbee2mqtt_line,
        reports_changes=True,
    ),
    # Washington State University's smart homes: date, time, sensor, value, perhaps an activity.
    "casas": TableForm(
        states={"open": DoorState.OPEN, "close": DoorState.CLOSED, "closed": DoorState.CLOSED},
        only=("D[0-9]*", "*Door*"),
        line=casas_line,
        reports_changes=True,
    ),
})  # fmt: skip
"""Published forms of other systems."""


def form_of(
    *, preset: str | None = None, columns: str | None = None, states: str | None = None,
    only: Sequence[str] = (), unit: TimeUnit | None = None,
) -> TableForm | None:  # fmt: skip
    """Return the form of the table by the options of a command line; None: our own.

    Args:
        preset: One of `PRESETS`; other arguments override it.
        columns: `time=last_changed,door=entity_id,state=state`.
        states: `on=open,off=closed`.
        only: Patterns of doors.
        unit: Of times that are numbers.

    Raises:
        CommandError: One of them cannot be.
    """
    if not (preset or columns or states or only or unit):
        return None
    form = PRESETS[preset] if preset else TableForm()
    named = dict(form.columns)
    if columns is not None:
        named = _pairs(columns, "--columns")
        if extra := named.keys() - set(COLUMNS):
            raise CommandError(
                f"--columns: expected {', '.join(COLUMNS)}, got {', '.join(sorted(extra))}"
            )
        if lacking := [name for name in COLUMNS[:3] if name not in named]:
            raise CommandError(
                f"--columns: expected time, door and state, got none for {', '.join(lacking)}"
            )
    told = {word.lower(): _state(name) for word, name in _pairs(states or "", "--states").items()}
    return TableForm(
        named, {**form.states, **told}, tuple(only) or form.only, unit or form.unit, form.line,
        form.reports_changes,
    )  # fmt: skip


def _pairs(text: str, option: str) -> dict[str, str]:
    """Return `a=b,c=d` as keys and values.

    Raises:
        CommandError: It is something else.
    """
    found = {}
    for pair in filter(None, map(str.strip, text.split(","))):
        key, equals, value = (part.strip() for part in pair.partition("="))
        if not equals or not value or key in found:
            raise CommandError(f"{option}: expected a=b,c=d with each a once, got {shown(text)}")
        found[key] = value
    return found


def _state(name: str) -> DoorState:
    try:
        return DoorState.parse(name)
    except ValueError as error:
        raise CommandError(f"--states: {error}") from None
