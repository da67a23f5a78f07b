"""How files of other systems say which door was how, and when: columns, words, units, lines."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from types import MappingProxyType
from typing import Literal

from semmap_log.domain.doors import DoorState
from semmap_log.errors import CommandError
from semmap_log.formats.parsing.problems import shown

TimeUnit = Literal["s", "ms", "us", "ns"]
DIGITS: Mapping[str, int] = MappingProxyType({"s": 0, "ms": 3, "us": 6, "ns": 9})
"""Unit of numbers since 1970 -> how many digits stand behind the second."""
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
    line: re.Pattern[str] | None = None
    """The form of a line with the groups time, door, state; None: a table with a header."""

    def takes(self, door: str) -> bool:
        """Tell whether a door is one of those that are read."""
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

PRESETS: Mapping[str, TableForm] = MappingProxyType({
    # "Download data" of the history panel: entity_id,state,last_changed; UTC with a Z.
    "home-assistant": TableForm(
        columns={"time": "last_changed", "door": "entity_id", "state": "state"},
        states={"on": DoorState.OPEN, "off": DoorState.CLOSED},
        only=("binary_sensor.*", "cover.*"),
    ),
    # Its log file, or `mosquitto_sub -F '%I %t %p'`: the messages of contact sensors.
    "zigbee2mqtt": TableForm(
        states={"true": DoorState.CLOSED, "false": DoorState.OPEN},
        line=re.compile(
            rf"^[^{{]*?(?P<time>{_DAY_AND_TIME}(?:Z|[+-]\d\d:?\d\d)?)[^{{]*?\bzigbee2mqtt/"
            r"(?P<door>[^{}'\"]+?)(?:'?, payload '|\s+)\{.*?"
            r'"(?:contact|garage_door_contact)"\s*:\s*(?P<state>true|false)\b'
        ),
    ),
    # Washington State University's smart homes: date, time, sensor, value, perhaps an activity.
    "casas": TableForm(
        states={"open": DoorState.OPEN, "close": DoorState.CLOSED, "closed": DoorState.CLOSED},
        only=("D[0-9]*", "*Door*"),
        line=re.compile(rf"^\s*(?P<time>{_DAY_AND_TIME})\s+(?P<door>\S+)\s+(?P<state>\S+)"),
    ),
})  # fmt: skip
"""Published forms of other systems."""


def form_of(
    *, preset: str | None = None, columns: str | None = None, states: str | None = None,
    only: Sequence[str] = (), unit: TimeUnit | None = None,
) -> TableForm | None:  # fmt: skip
    """Return the form that a command line tells; None: our own.

    Args:
        preset: One of `PRESETS`; what else is told wins over it.
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
        named, {**form.states, **told}, tuple(only) or form.only, unit or form.unit, form.line
    )


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
