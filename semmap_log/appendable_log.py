"""A log that takes events: one commit at a time, each checked against the map as it stands."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
from types import TracebackType
from typing import TYPE_CHECKING

from semmap_log.commands import Gatekeeper, Roster, resolve_door
from semmap_log.commits import Commit, Note
from semmap_log.door_log import DoorLog
from semmap_log.doors import DoorId, DoorMap
from semmap_log.events import Event, RobotPose
from semmap_log.log.reader import LogReader
from semmap_log.log.writer import LogWriter
from semmap_log.projections.door_map import DoorMapState

if TYPE_CHECKING:
    from typing_extensions import Self

POSES_WAIT_S = 1.0
"""Robot poses join the next commit; without one, they are written after this time."""


@dataclass(frozen=True, slots=True)
class Appended:
    """What became of an append."""

    commit: Commit
    poses: int = 0
    """How many robot poses, which had waited, stand before its own events in the commit."""
    repeated: bool = False
    """The command was stored before; nothing was written now."""

    @property
    def first_event(self) -> int:
        """Number of its own first event."""
        return self.commit.first_event + self.poses

    @property
    def count(self) -> int:
        """How many events of its own it has."""
        return self.commit.count - self.poses


class AppendableLog(DoorLog):
    """A log that is written; answers questions, too. May be used by several threads."""

    def __init__(self, writer: LogWriter) -> None:
        super().__init__(writer.folder)
        self._writer = writer
        self._mutex = threading.RLock()
        self._poses: list[RobotPose] = []
        self._pose_timer: threading.Timer | None = None
        self._is_stale = False
        self._roster: Roster | None = None
        self._named: DoorMap | None = None
        """A map as of some moment since which no name has changed."""

    @property
    def reader(self) -> LogReader:
        """The bytes underneath, with all that was written so far."""
        with self._mutex:
            if self._is_stale:
                self._reader.refresh()
                self._is_stale = False
            return self._reader

    @property
    def state(self) -> DoorMapState:
        """The door map after the last commit, as the writer holds it."""
        with self._mutex:
            return self._writer.state

    @property
    def roster(self) -> Roster:
        """Which doors and levels there are after the last commit."""
        with self._mutex:
            if self._roster is None:
                self._roster = Roster.of(self._writer.state)
            return self._roster

    def end_ns(self) -> int:
        """Return the log's end: the latest happened time in it; 0 for a log without events."""
        return self.state.latest_happened_ns

    def now_ns(self) -> int:
        """Return what the log's clock says: nanoseconds since 1970, UTC."""
        return self._writer.clock.wall_ns()

    def append(
        self,
        events: Iterable[Event],
        *,
        note: Note = Note(),
        command_id: bytes | None = None,
        sync: bool = True,
    ) -> Appended:
        """Append events as one commit, all or none; waiting robot poses go before them.

        Args:
            events: At least one.
            note: Who, with what, why.
            command_id: 16 bytes; a command that is stored already is not stored again.
            sync: Durable on return; otherwise once `sync` has returned.

        Raises:
            CommandError: The map forbids an event; nothing is written.
            LogPoisonedError: A write failed; the outcome is unknown until the log is reopened.
        """
        return self._append_once(lambda: events, note, command_id, sync=sync)

    def sync(self) -> None:
        """Return once every commit so far survives a power cut."""
        with self._mutex:
            self._writer.sync()

    def find_command(self, command_id: bytes, *, everywhere: bool = False) -> Commit | None:
        """Return the commit that a command became, if it is stored.

        Args:
            command_id: 16 bytes.
            everywhere: Look in the whole log, not only in its last 10,000 commits or so.
        """
        with self._mutex:
            return self._writer.find(command_id, everywhere=everywhere)

    def robot_pose(self, pose: RobotPose) -> None:
        """Keep a pose for the next commit; if none comes within a second, it gets its own."""
        with self._mutex:
            self._writer.check_usable()
            if pose.happened_ns is None:
                pose = replace(pose, happened_ns=self.now_ns())
            self._poses.append(pose)
            if self._pose_timer is None:
                self._pose_timer = threading.Timer(POSES_WAIT_S, self._write_poses)
                self._pose_timer.daemon = True
                self._pose_timer.start()

    def resolve(self, door: str | int) -> DoorId:
        """Return the door of that id, name, or level/name, as of now."""
        if isinstance(door, int):
            return DoorId(door)  # whether it is there, the gatekeeper says
        with self._mutex:
            if self._named is None:
                self._named = self._writer.state.door_map()
            return resolve_door(door, self._named)

    def level_of(self, door: DoorId) -> int:
        """Return the level that a door is on; 0 for one that is not there."""
        known = self.state.door_map().doors.get(door)
        return known.level if known else 0

    def close(self) -> None:
        """Write what waits, close the segment so that every tool reads it, let the lock go."""
        with self._mutex:
            try:
                self._write_poses()
            finally:
                self._poses = []
                self._writer.close()
                self._is_stale = True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _append_once(
        self,
        make: Callable[[], Iterable[Event]],
        note: Note,
        command_id: bytes | None,
        *,
        sync: bool = True,
    ) -> Appended:
        """Append the events that `make` gives, unless their command is stored already.

        What is asked of the map to make them is asked only then: a command that is sent again may
        speak of a door that it has removed itself.
        """
        with self._mutex:
            known = None if command_id is None else self._writer.find(command_id)
            if known is not None:
                return Appended(known, repeated=True)
            poses = self._poses
            gatekeeper = Gatekeeper(self.roster, self._writer.next_event + len(poses))
            try:
                commit = self._writer.append(
                    chain(poses, _checked(make(), gatekeeper)),
                    note=note,
                    command_id=command_id,
                    sync=sync,
                )
            finally:
                self._is_stale = True
            self._poses = []
            gatekeeper.settle(commit)
            if not gatekeeper.keeps_names:
                self._named = None
            self._roster = None if gatekeeper.has_retraction else gatekeeper.roster
            return Appended(commit, len(poses))

    def _write_poses(self) -> None:
        with self._mutex:
            if self._pose_timer is not None:
                self._pose_timer.cancel()
                self._pose_timer = None
            if self._poses:
                self._writer.append(self._poses)
                self._poses = []
                self._is_stale = True


def _checked(events: Iterable[Event], gatekeeper: Gatekeeper) -> Iterator[Event]:
    """Pass the events on, each once it is checked."""
    for event in events:
        gatekeeper.check(event)
        yield event
