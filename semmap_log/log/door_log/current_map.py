"""The map as it stands, while a log is written: what commands are made of and checked against."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import PurePath
from threading import RLock
from weakref import WeakMethod

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.io.clock import believable_ns
from semmap_log.core.model.commits import Commit
from semmap_log.core.model.doors import DoorId, DoorMap
from semmap_log.core.model.events import Event, RobotPose, is_whole_number
from semmap_log.errors import InvalidEventError, UnexpectedEventError, UnknownDoorError
from semmap_log.log.door_log.door_index import DoorIndex
from semmap_log.log.door_log.door_names import resolve_door
from semmap_log.log.door_log.known_past import KnownPast
from semmap_log.log.door_log.removed_doors import removed_called, several_removed
from semmap_log.log.door_log.times import Time, happened_ns_of
from semmap_log.log.replay.written_state import WrittenState
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing.writer_opening import OpenedLog


class CurrentMap:
    """The door map after the last commit, and what waits for the next.

    The appender tells it what a commit has left as it was (`index`, `doors`); the rest is asked of
    the log again when it is needed. May be asked by several threads.
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
        self.doors: DoorMap | None = None
        """A map as of some moment since which no name has changed; None: there is none."""
        self.past = KnownPast(WeakMethod(self._get_reader))
        """What the log still holds of its past."""
        self.next_event = opened.writer.next_event
        """Events below this number are taken into account in all of these."""

    def take_in(self) -> None:
        """Forget what does not fit any more: an interrupt came right behind a commit."""
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
        """Look at the log's folder; who reads with the reader of before goes on with that."""
        with self._lock:
            self._reader = self._reader.refreshed()
            self.is_read = True

    @property
    def state(self) -> DoorMapState:
        """The door map after the last commit, as the writer holds it."""
        with self._lock:
            return self._written.get()

    def door_map(self) -> DoorMap:
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

    def resolve(self, door: str | int) -> DoorId:
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
            except UnknownDoorError:
                removed = removed_called(door, self._written.get())
                if len(removed) > 1:
                    raise UnknownDoorError(several_removed(door, removed)) from None
                if removed:
                    return removed[0]  # that it was removed, the validator says
                raise

    def check_last_event(self, expected: int, door: DoorId | None) -> None:
        """Return if the last event is the one that a caller expects.

        Args:
            expected: Its number; -1: there is none.
            door: The last about this door; None: the last of the log.

        Raises:
            UnexpectedEventError: It is another.
            InvalidEventError: That is no number.
        """
        if not is_whole_number(expected):
            raise InvalidEventError("expected_event", "the number of an event, or -1", expected)
        if door is None:
            of, actual = "the log", self._writer.next_event - 1
        else:
            of, actual = f"door {door}", self.state.last_event(door)
        if expected != actual:
            raise UnexpectedEventError(of, expected, actual)

    def events_of(self, commit: Commit) -> Iterator[Event]:
        """Yield the events of a commit, as far as they were not taken out."""
        reader = self.reader
        window = reader.window_of(commit.first_event, commit.last_event)
        for batch in reader.batches(window, with_newer=True):
            yield from (recorded.event for recorded in batch)


def _names_now(written: WrittenState) -> Mapping[DoorId, str]:
    return written.get().names()
