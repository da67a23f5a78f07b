"""The map as it stands, while a log is written: what commands are made of and checked against.

Commands are requests to append to a log, as values. A command states who requests it and why, and
makes its events from the map as it stands when its turn comes: a repeated one may name a door that
it has removed itself. Commands can also be about objects that are no doors: their class, place and
states.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import PurePath
from threading import RLock
from typing import NamedTuple, TypeAlias
from weakref import WeakMethod

from semmap_log import errors
from semmap_log.core.batches.event_batch import EventBatch, one_by_one
from semmap_log.core.folds.door_index import (
    DoorIndex,
    ambiguous_removed,
    removed_by_name,
    resolve_door,
)
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.rebasing import are_same
from semmap_log.core.io.clock import believable_ns
from semmap_log.core.model import doors
from semmap_log.core.model.commits import NO_CONTENT, Commit, Note
from semmap_log.core.model.events import ClassDefined, Event, RobotPose, is_whole_number
from semmap_log.core.model.moments import Time, happened_ns_of
from semmap_log.log.door_log.known_past import KnownPast
from semmap_log.log.replay.written_state import WrittenState
from semmap_log.store.gone_commands import StoredCommand
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing.writer_opening import OpenedLog

DIGITS = 9
"""Of the corners of an outline that is stored: nanometres."""


@dataclass(frozen=True, slots=True)
class NewPlace:
    """Where an object is: start, direction and length of its line; NaN: it is unplaced."""

    x: float
    y: float
    theta: float
    width: float

    def of(self, kind: doors.ObjectClass, outline: doors.Corners) -> tuple[NewPlace, str]:
        """Return where an object of a class is, and the annotation of its outline; "": it has none.

        Args:
            kind: Its class. A point and a polygon have no width, and need no direction.
            outline: The corners of a polygon, metres, frame `map`. Where no place is given, the
                first is its place.

        Raises:
            CommandError: A polygon without an outline, or one for what is no polygon.
        """
        if kind.geometry is not doors.Geometry.POLYGON and outline:
            raise errors.CommandError(f"an outline is for polygons; a {kind.name} is a "
                               f"{kind.geometry.value}.")  # fmt: skip
        if kind.geometry is doors.Geometry.SEGMENT:
            return self, ""
        if kind.geometry is doors.Geometry.POLYGON and len(outline) < doors.LEAST_CORNERS:
            raise errors.CommandError(
                f"a {kind.name} is a polygon: expected an outline of at least "
                f"{doors.LEAST_CORNERS} corners, got {len(outline)}."
            )
        if outline:
            check_outline(doors.outline_text(outline))
        x, y = (self.x, self.y) if outline == () or not math.isnan(self.x) else outline[0]
        if math.isnan(x):
            return self, ""
        place = NewPlace(x, y, 0.0 if math.isnan(self.theta) else self.theta, 0.0)
        return place, doors.outline_text([place.seen(corner) for corner in outline])

    def seen(self, point: tuple[float, float]) -> tuple[float, float]:
        """Return a point of the frame `map` in the object's own frame, metres."""
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        x, y = point[0] - self.x, point[1] - self.y
        return round(cos * x + sin * y, DIGITS) + 0.0, round(cos * y - sin * x, DIGITS) + 0.0


def class_meant(name: str, now: CurrentMap) -> doors.ObjectClass:
    """Return the class of that name; "" and `door`: that of doors.

    Raises:
        CommandError: None is defined that is called so.
    """
    known = now.door_index.classes
    if name in ("", doors.DOOR.name):
        return doors.DOOR
    if name not in known:
        defined = f"defined are: {', '.join(sorted(known))}" if known else "none is defined"
        raise errors.CommandError(f"no class {name!r}; {defined}. `define` defines one.")
    return known[name]


def state_meant(state: doors.DoorState | str, of: doors.ObjectClass) -> doors.DoorState:
    """Return the state that a word means for an object of a class.

    Args:
        state: A state, or the class's word for it, or its name, in any case of letters.
        of: The class.

    Raises:
        InvalidEventError: The class has no such state.
    """
    if isinstance(state, doors.DoorState) and (of is doors.DOOR or of.has(state)):
        return state
    try:
        return of.state(state if isinstance(state, str) else state.name)
    except ValueError:
        got = state if isinstance(state, str) else state.name
        raise errors.InvalidEventError("state", f"one of {of.state_words}", got) from None


def class_of(door_id: doors.DoorId, now: CurrentMap) -> doors.ObjectClass:
    """Return what an object is; of what is not in the map: a door."""
    known = now.state.door(door_id) if now.door_index.classes else None
    return known.object_class if known else doors.DOOR


def earlier_definition(
    kind: doors.ObjectClass, happened_ns: int | None, now: CurrentMap
) -> Iterator[ClassDefined]:
    """Yield a class's definition again if an object has the class before its definition."""
    defined = None if kind.is_door else now.state.defined(kind.name)
    if happened_ns is not None and defined is not None and happened_ns < defined[0]:
        yield ClassDefined.of(kind, happened_ns)


def check_annotation(key: str, value: str, now: CurrentMap) -> None:
    """Check an annotation that makes an object what it is: its class or its outline.

    Raises:
        CommandError: No class has that name, though there are others; or it is no outline.
    """
    if key == doors.CLASS and value and now.door_index.classes:
        class_meant(value, now)
    if key == doors.OUTLINE and value and now.door_index.classes:
        check_outline(value)


def check_outline(text: str) -> None:
    """Check that an annotation states an outline.

    Raises:
        CommandError: It states none.
    """
    try:
        doors.parse_outline(text)
    except ValueError as error:
        raise errors.CommandError(f"outline: {error}") from None


Events: TypeAlias = "Iterable[Event | EventBatch] | EventBatch"
"""What can be appended: events, and batches of them, in any order."""


class CommandContext(NamedTuple):
    """When, who and why: the parts of a command that are the same for every kind."""

    at: Time = None
    """When it happened; None: when it is recorded."""
    note: Note = Note()
    """Who, with what, why."""
    command_id: bytes | None = None
    """16 bytes: the same command, sent again, is stored once."""
    expected_event: int | None = None
    """Number of the last event, as the caller knows it; -1: none; None: nothing is expected."""


@dataclass(frozen=True, slots=True)
class Command(ABC):
    """What is to be appended as one commit, all or none."""

    context: CommandContext

    @property
    @abstractmethod
    def content(self) -> bytes:
        """Digest of what it asks for, 16 bytes, by which it is known when it is sent again."""

    @abstractmethod
    def events(self, now: CurrentMap) -> Iterable[Event | EventBatch]:
        """Return its events, as the map stands.

        Raises:
            CommandError: The map forbids it.
        """

    def is_stored_as(self, commit: Commit, events: Sequence[Event]) -> bool:
        """Return whether a commit with its id is the one that it became.

        Args:
            commit: The commit.
            events: All of its events.
        """
        del events
        return commit.content == self.content

    def is_sealed_as(self, stored: StoredCommand) -> bool:
        """Return whether a command with its id, of which something was taken out, is this one."""
        return stored.has_content(self.content)

    @property
    def own_count(self) -> int | None:
        """How many events it has; None: none of them is a pose, so that it shows."""
        return None

    def door_expected(self, events: Iterable[Event | EventBatch]) -> doors.DoorId | None:
        """Return the door whose last event `expected_event` is; None: it is the log's last event.

        Args:
            events: Its own, as the map stands.
        """
        del events
        return None


@dataclass(frozen=True, slots=True)
class GivenEvents(Command):
    """Events that the caller has made; a repeated command is recognised by them or by a digest."""

    given: Iterable[Event | EventBatch]
    content: bytes = NO_CONTENT

    @classmethod
    def of(
        cls, events: Events, context: CommandContext, content: bytes = NO_CONTENT
    ) -> GivenEvents:
        """Return the command; its events are read at once only if they may have to be compared."""
        given = [events] if isinstance(events, EventBatch) else events
        if context.command_id is not None and content == NO_CONTENT and not isinstance(given, list):
            given = list(given)
        return cls(context, given, content)

    def events(self, now: CurrentMap) -> Iterable[Event | EventBatch]:
        """Return what was given."""
        del now
        return self.given

    @property
    def own_count(self) -> int | None:
        """How many there are; None: they come one after the other."""
        if not isinstance(self.given, Sequence) or not self.given:
            return None
        return sum(len(one) if isinstance(one, EventBatch) else 1 for one in self.given)

    def is_stored_as(self, commit: Commit, events: Sequence[Event]) -> bool:
        """Return whether the digest is the commit's; without one, compares events and note."""
        if self.content != NO_CONTENT:
            return commit.content == self.content
        wanted = list(one_by_one(self.given))
        return self.context.note == commit.note and are_same(wanted, events[-len(wanted) :])

    def is_sealed_as(self, stored: StoredCommand) -> bool:
        """Return the same, by the digest, or by the events and the note."""
        if self.content != NO_CONTENT or stored.seal is None:
            return stored.has_content(self.content)
        command_id = stored.commit.command_id
        return stored.seal.fits(
            command_id, NO_CONTENT, self.context.note, list(one_by_one(self.given))
        )


@dataclass(frozen=True, slots=True)
class LazyEvents(Command):
    """Events that are made when the command's turn has come, if they are wanted then."""

    make: Callable[[], Sequence[Event]]
    content: bytes

    def events(self, now: CurrentMap) -> Sequence[Event]:
        """Return what is made."""
        del now
        return self.make()


@dataclass(frozen=True, slots=True)
class ImportedCommit(Command):
    """A commit of another log."""

    make: Callable[[int], Iterable[Event | EventBatch]]
    """Returns its events; called with the number that the first of them gets."""
    content: bytes

    def events(self, now: CurrentMap) -> Iterable[Event | EventBatch]:
        """Return what is given."""
        return self.make(now.next_event)


WAITING_POSES = GivenEvents(CommandContext(), ())
"""No events of its own: what waits is written."""


class CurrentMap:
    """The door map after the last commit, and what waits for the next.

    The appender reports what a commit has left unchanged (`index`, `doors`); the rest is read from
    the log again when it is needed. Several threads may use it.
    """

    def __init__(self, opened: OpenedLog[WrittenState], lock: RLock) -> None:
        """Begin.

        Args:
            opened: The log, whose door map is known.
            lock: Held by whoever appends, and by whoever asks.
        """
        self._writer, self._reader, self._written = opened.writer, opened.reader, opened.keyframes
        self._lock = lock
        self.path: PurePath = self._reader.given
        self._timezone = self._reader.info.timezone
        self.is_read = True
        """Whether the reader has seen all that was written."""
        self.waiting: list[RobotPose] = []
        """Robot poses that the next commit takes with it."""
        self.index: DoorIndex | None = None
        """Which doors and levels there are; None: `door_index` finds out."""
        self.doors: doors.DoorMap | None = None
        """A map as of some moment since which no name has changed, or None."""
        self.past = KnownPast(WeakMethod(self._get_reader))
        """What the log still holds of its past."""
        self.next_event = opened.writer.next_event
        """Events below this number are taken into account in all of these."""

    def take_in(self) -> None:
        """Forget what is out of date: an interrupt came right after a commit."""
        if self.next_event != self._writer.next_event:
            self.waiting, self.index, self.doors, self.is_read = [], None, None, False
            self.next_event = self._writer.next_event

    def _get_reader(self) -> LogReader:
        return self.reader

    @property
    def reader(self) -> LogReader:
        """The bytes underneath, with all that was written so far."""
        with self._lock:
            self.take_in()
            if not self.is_read:
                self._writer.flush()
                self.refresh()
            return self._reader

    def refresh(self) -> None:
        """Read the log's folder again; users of the previous reader keep that."""
        with self._lock:
            self._reader = self._reader.refreshed()
            self.is_read = True

    @property
    def state(self) -> DoorMapState:
        """The door map after the last commit, as the writer holds it."""
        with self._lock:
            return self._written.get()

    def door_map(self) -> doors.DoorMap:
        """Return the doors after the last commit as values, whatever is appended meanwhile."""
        with self._lock:
            return self._written.get().door_map()

    @property
    def door_index(self) -> DoorIndex:
        """Which doors and levels there are after the last commit."""
        with self._lock:
            self.take_in()
            if self.index is None:
                self.index = DoorIndex.of(self._written.get())
                self.index.log = self.path
                # Not of this object: what holds itself is let go of late.
                self.index.names = partial(_names_now, self._written)
            return self.index

    def now_ns(self) -> int:
        """Return what the log's clock says: nanoseconds since 1970, UTC."""
        return believable_ns(self._writer.clock)

    def happened_ns(self, at: Time) -> int | None:
        """Return when a command says that it happened; what is relative counts from now.

        Raises:
            MomentError: It cannot be read, or is the number of an event.
        """
        return happened_ns_of(at, tz=self._timezone, now_ns=self.now_ns())

    def level_meant(self, level: int | str | None) -> int:
        """Return the level that a caller means: as `DoorIndex.level_meant`."""
        with self._lock:
            return self.door_index.level_meant(level)

    def resolve(self, door: str | int) -> doors.DoorId:
        """Return the door of that id, name, or level/name; one that was removed, too.

        Raises:
            UnknownDoorError: None is called so, or more than one.
        """
        with self._lock:
            self.take_in()
            if self.doors is None:
                self.doors = self._written.get().door_map()
            try:
                return resolve_door(door, self.doors)
            except errors.UnknownDoorError:
                removed = removed_by_name(door, self._written.get())
                if len(removed) > 1:
                    raise errors.UnknownDoorError(ambiguous_removed(door, removed)) from None
                if removed:
                    return removed[0]  # that it was removed, the validator says
                raise

    def check_last_event(self, expected: int, door: doors.DoorId | None) -> None:
        """Check that the last event is the one that a caller expects.

        Args:
            expected: Its number; -1: no event.
            door: The last about this door; None: the last of the log.

        Raises:
            UnexpectedEventError: It is another.
            InvalidEventError: That is no number.
        """
        if not is_whole_number(expected):
            raise errors.InvalidEventError(
                "expected_event", "the number of an event, or -1", expected
            )
        if door is None:
            of, actual = "the log", self._writer.next_event - 1
        else:
            of, actual = f"door {door}", self.state.last_event(door)
        if expected != actual:
            raise errors.UnexpectedEventError(of, expected, actual)

    def events_of(self, commit: Commit) -> Iterator[Event]:
        """Yield the events of a commit, as far as they were not taken out."""
        reader = self.reader
        window = reader.window_of(commit.first_event, commit.last_event)
        for batch in reader.batches(window, with_newer=True):
            yield from (recorded.event for recorded in batch)


def _names_now(written: WrittenState) -> Mapping[doors.DoorId, str]:
    return written.get().names()
