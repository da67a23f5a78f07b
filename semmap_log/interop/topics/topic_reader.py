"""What readers of messages share: what they look at, what they make, how they look doors up.

`Known` is what the log knows, as far as messages are compared with it, after each event.
`TopicProblems` has what is wrong with messages: reported once for each kind, counted, summed up.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.levels import resolve_level
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model import events as ev
from semmap_log.core.model.doors import Door, DoorId, DoorMap, next_door_id
from semmap_log.core.model.meaning import Presence
from semmap_log.errors import UnknownDoorError, UnknownLevelError
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.interop.topics.topic_rules import RosMapping, Unknown
from semmap_log.log import DoorLog


@dataclass(frozen=True, slots=True)
class TopicMessage:
    """A message that was decoded."""

    topic: str
    message: Any
    received_ns: int
    """When it came: by the bag, or by the node's clock."""
    ros_type: str = ""
    """In the long form."""


@dataclass(slots=True)
class Context:
    """What the readers of all topics have in common."""

    mapping: RosMapping
    known: Known
    complaints: TopicProblems
    _begun: DoorMap = field(init=False)
    """The map when the reading began."""

    def __post_init__(self) -> None:
        self._begun = self.known.door_map()

    def level(self, text: str | None) -> int:
        """Return the level of that number or name; None: the mapping's, or the log's only one.

        Of the levels that the log had when the reading began: which topic is seen first does not
        count.

        Raises:
            UnknownLevelError: There is none, or there are several.
        """
        return resolve_level(self.mapping.level if text is None else text, self._begun)

    def happened_ns(self, got: TopicMessage, stamp: Any = None) -> int:
        """Return when a message's content happened; see the function of that name.

        Raises:
            ValueError: It came at a time that no log can hold.
        """
        if got.received_ns == 0:
            kind = "a message that came at time 0, before any clock: it counts at 1970-01-01"
            self.complaints.add(got.topic, kind)
        return happened_ns(stamp, got.received_ns, within_s=self.mapping.stamps_within_s)


class TopicReader(Protocol):
    """Makes events of the messages of a topic.

    They are taken in by `Context.known` before the next one is made. Whatever a message
    lacks may raise: AttributeError and the like are complained about by who calls.
    """

    def events(self, got: TopicMessage) -> Iterable[ev.Event]:
        """Return what a message says, as events."""

    def actor(self, got: TopicMessage) -> str:
        """Return who did it, if the message says so."""


class DoorsByName:
    """Finds the door that a message names, or makes one."""

    def __init__(self, topic: str, context: Context, unknown: Unknown, level: str | None) -> None:
        self._topic = topic
        self._context = context
        self._unknown = unknown
        self._level = context.mapping.level if level is None else level
        """Of new doors, and of names that several levels have; None: the only one."""
        if self._level is not None:
            context.level(self._level)  # or there is none

    def find(
        self, name: str, happened_ns: int | None, *, or_id: bool = True
    ) -> tuple[DoorId | None, list[ev.Event]]:
        """Return the door, and the events that make it where it is new; None: passed over.

        Args:
            name: As the mapping has it, or the message; blanks around it do not count.
            happened_ns: When a new door came to be.
            or_id: The name can be an id of ours: the mapping says it.
        """
        known, complaints, name = self._context.known, self._context.complaints, name.strip()
        try:
            door_id = known.called(name, or_id=or_id, level=self._level)
        except UnknownDoorError as error:
            complaints.add(self._topic, "a name that is not clear; passed over", f"{name} {error}")
            return None, []
        if door_id is not None or self._unknown == "ignore":
            return door_id, []
        if self._unknown == "error":
            complaints.add(self._topic, "an unknown door; passed over", shown(name))
            return None, []
        try:
            level, plain = self._placed(name)
        except UnknownLevelError as error:
            complaints.add(self._topic, "a new door, and no level for it; passed over",
                           f"{shown(name)}: {error}")  # fmt: skip
            return None, []
        new = known.next_id
        return new, [
            ev.DoorAdded(door_id=new, level=level, happened_ns=happened_ns),
            ev.DoorAnnotated(door_id=new, key="name", value=plain, happened_ns=happened_ns),
        ]

    def _placed(self, name: str) -> tuple[int, str]:
        """Return level and name of a new door; the name may begin with the level's.

        Raises:
            UnknownLevelError: There are several levels, and nobody says which is meant.
        """
        level, _, plain = name.partition("/")
        if level and plain:
            with suppress(UnknownLevelError):
                return self._context.level(level), plain
        return self._context.level(self._level), name


def field_of(message: Any, path: str) -> Any:
    """Return the field at a path with dots.

    Raises:
        AttributeError: There is none.
    """
    for name in path.split("."):
        message = getattr(message, name)
    return message


def deviations(covariance: Any) -> tuple[float, float]:
    """Return the standard deviations in the plane and around z; NaN where none is given.

    The covariance is of x, y, z and rotations about X, Y, Z, row by row: 6 x 6. All zeros are what
    a publisher sends that knows none.
    """
    x, y, theta = (float(covariance[i]) for i in (0, 7, 35))
    in_plane = (x + y) / 2
    return (
        math.sqrt(in_plane) if 0 < in_plane < math.inf else math.nan,
        math.sqrt(theta) if 0 < theta < math.inf else math.nan,
    )


def happened_ns(stamp: Any, received_ns: int, *, within_s: float) -> int:
    """Return when it happened, nanoseconds since 1970.

    A stamp counts that lies at most `within_s` before the message came, and not after it: robots
    stamp what they have just measured, and with a clock that is set. A stamp of zero is none; an
    older one may be that of a map that was loaded long ago, or of a clock that is wrong. Then it
    counts when the message came: 0 under `use_sim_time` before the first `/clock`, as what was
    there before the simulation began.

    Args:
        stamp: With `sec` and `nanosec`; None: the message has none.
        received_ns: When the message came: by the bag, or by the node's clock, which is `/clock`
            under `use_sim_time`.
        within_s: See above.

    Raises:
        ValueError: It came before 1970, or after 2262.
    """
    if not 0 <= received_ns <= MAX_TIME_NS:
        raise ValueError(f"it came at {received_ns / 1e9:.0f} s, which is not from 1970 to 2262")
    if stamp is not None:
        told_ns = int(stamp.sec) * 10**9 + int(stamp.nanosec)
        if told_ns > 0 and received_ns - int(within_s * 1e9) <= told_ns <= received_ns:
            return told_ns
    return received_ns


@dataclass(slots=True)
class TopicProblems:
    """A count for each topic and kind of trouble, with what was seen first."""

    tell: Callable[[str], None] = lambda _: None
    """Hears of each kind when it comes for the first time."""
    _counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    _first: dict[tuple[str, str], str] = field(default_factory=dict)

    def add(self, topic: str, kind: str, example: object = "") -> None:
        """Note trouble.

        Args:
            topic: Where.
            kind: What, without values: so many kinds there are, so many lines.
            example: The values.
        """
        key = (topic, kind)
        self._counts[key] += 1
        if key not in self._first:
            self._first[key] = str(example)[:MOST_SHOWN]
            self.tell(self._line(key))

    def __len__(self) -> int:
        return self._counts.total()

    def lines(self) -> tuple[str, ...]:
        """Return each kind with how often it came."""
        return tuple(
            self._line(key) + (f" ({count:,} times)" if count > 1 else "")
            for key, count in sorted(self._counts.items())
        )

    def _line(self, key: tuple[str, str]) -> str:
        example = f": {self._first[key]}" if self._first[key] else ""
        return f"{key[0]}: {key[1]}{example}"


MOST_SHOWN = 200


class Known:
    """The doors that are there, and what else messages are measured by."""

    def __init__(self, state: DoorMapState | None = None) -> None:
        """Begin with a state, which is changed from here on."""
        self._state = state or DoorMapState()
        self.floor_maps: dict[int, ev.FloorMap] = {}
        """By the level; those that are looked up."""
        self.last_started = 0
        """The greatest number of a round that began."""
        self.last_finished = 0
        self._doors: dict[int, Door] = {
            door.door_id: door for door in self._state.door_map().doors.values()
        }
        self._stale: set[int] = set()
        """Doors that an event was about since they were made."""
        self._named: dict[str, set[int]] = {}
        for door in self._doors.values():
            self._call(door.door_id, None, door.name)

    @classmethod
    def of(cls, log: DoorLog) -> Known:
        """Return what a log knows now."""
        state = log.state_in()
        known = cls(state)
        for level in state.door_map().levels.values():
            if level.floor_map_event is not None:
                drawn = log.event(level.floor_map_event).event
                assert isinstance(drawn, ev.FloorMap)
                known.floor_maps[level.level] = drawn
        known.last_started = log.last_patrol(ev.PatrolStarted)
        known.last_finished = log.last_patrol(ev.PatrolFinished)
        return known

    @property
    def doors(self) -> Mapping[int, Door]:
        """Those in the map."""
        for door_id in self._stale:
            door = self._state.door(door_id)
            if door is None:
                self._doors.pop(door_id, None)
            else:
                self._doors[door_id] = door
        self._stale.clear()
        return self._doors

    @property
    def used_ids(self) -> Collection[int]:
        """Every id that was ever given."""
        return self._state.used_door_ids

    def added_ns(self, door_id: int) -> int:
        """Return when a door came into the map; 0: that is not known."""
        stamp = self._state.stamp(door_id, "added")
        return stamp[0] if stamp else 0

    @property
    def next_id(self) -> DoorId:
        """The id after the greatest that was ever given: see `next_door_id`."""
        return self.next_id_but(frozenset())

    def next_id_but(self, others: Collection[int]) -> DoorId:
        """Return a new id that is none of some others that want to stay free."""
        return next_door_id({*self.used_ids, *others}, max(self.used_ids, default=0))

    def called(self, text: str, *, or_id: bool = True, level: str | None = None) -> DoorId | None:
        """Return the door of that name, level/name or id; None: there is none.

        Args:
            text: What it is called.
            or_id: People write an id, too; a robot's own names are names, even if they are digits.
            level: Number or name of the level that is meant where several have the name.

        Raises:
            UnknownDoorError: It can mean several.
        """
        found = set(self._named.get(text, ()))
        if len(found) > 1 and level is not None:
            found = {i for i in found if level in self._names_of_level(i)}
        if not found and "/" in text:
            level, _, name = text.partition("/")
            found = {i for i in self._named.get(name, ()) if level in self._names_of_level(i)}
        if not found and or_id and text.isdecimal() and self._state.is_present(int(text)):
            found = {int(text)}
        if len(found) > 1:
            ids = ", ".join(map(str, sorted(found)))
            raise UnknownDoorError(f"can mean doors {ids}; write level/name, or the id")
        return DoorId(next(iter(found))) if found else None

    def door_map(self) -> DoorMap:
        """Return the map as it is now, whatever is applied later."""
        return self._state.door_map()

    def apply(self, event: ev.Event) -> None:
        """Take in what an event changes; one without a time happens last of all."""
        if event.happened_ns is None:
            event = replace(event, happened_ns=self._state.latest_happened_ns)
        before = self._name_of(event)
        self._state.apply_one(event, self._state.event + 1)
        if isinstance(event, ev.DoorEvent):
            self._stale.add(event.door_id)
            self._call(event.door_id, before, self._name_of(event))
        elif isinstance(event, ev.ClassDefined):
            self._stale.update(self._doors)
        elif isinstance(event, ev.FloorMap):
            self.floor_maps[event.level] = event
        elif isinstance(event, ev.PatrolStarted):
            self.last_started = max(self.last_started, event.patrol)
        elif isinstance(event, ev.PatrolFinished):
            self.last_finished = max(self.last_finished, event.patrol)

    def _name_of(self, event: ev.Event) -> str | None:
        """Return what the door is called that an event may call otherwise."""
        if isinstance(event, ev.DoorAnnotated) or event.effect.presence is not Presence.STAYS:
            door = self._state.door(event.door_id)  # type: ignore[attr-defined]
            return door.name if door else None
        return None

    def _call(self, door_id: int, before: str | None, name: str | None) -> None:
        if before != name:
            self._named.get(before or "", set()).discard(door_id)
            if name:
                self._named.setdefault(name, set()).add(door_id)

    def _names_of_level(self, door_id: int) -> tuple[str, str]:
        level = self._state.level_of(door_id)
        return str(level), self._state.level_names().get(level) or str(level)
