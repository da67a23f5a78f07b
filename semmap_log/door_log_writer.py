"""A door map's log that is written: each call is one commit, durable when it returns."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from types import TracebackType
from typing import TYPE_CHECKING, TypedDict

from semmap_log.commands import Gatekeeper, Roster, resolve_door
from semmap_log.commits import Commit, Note
from semmap_log.door_log import DoorLog, Time
from semmap_log.doors import NAN, DoorId, DoorMap, DoorState
from semmap_log.errors import CommandError, MomentError
from semmap_log.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    DoorUpdated,
    Event,
    PatrolFinished,
    PatrolStarted,
    RobotPose,
)
from semmap_log.log.reader import LogReader
from semmap_log.log.writer import LogWriter
from semmap_log.projections.door_map import DoorMapState

if TYPE_CHECKING:
    from typing_extensions import Self, Unpack

POSES_WAIT_S = 1.0
"""Robot poses join the next commit; without one, they are written after this time."""


class About(TypedDict, total=False):
    """What every command takes besides its own arguments."""

    at: Time
    """When it happened; default: now."""
    actor: str
    source: str
    reason: str
    correlation: str
    command_id: bytes | None
    """16 bytes: the same command, sent again, is stored once."""


@dataclass(frozen=True, slots=True)
class Appended:
    """What became of an append."""

    commit: Commit
    repeated: bool = False
    """The command was stored before; nothing was written now."""

    @property
    def first_event(self) -> int:
        """Number of its first event."""
        return self.commit.first_event


class DoorLogWriter(DoorLog):
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
    def roster(self) -> Roster:
        """Which doors and levels there are after the last commit."""
        if self._roster is None:
            self._roster = Roster.of(self._writer.state)
        return self._roster

    @property
    def reader(self) -> LogReader:
        """The bytes underneath, with all that was written so far."""
        if self._is_stale:
            self._reader.refresh()
            self._is_stale = False
        return self._reader

    @property
    def state(self) -> DoorMapState:
        """The door map after the last commit, as the writer holds it."""
        with self._mutex:
            return self._writer.state

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
        with self._mutex:
            if command_id is not None:
                known = self._writer.find(command_id)
                if known is not None:
                    return Appended(known, repeated=True)
            self._is_stale = True
            gatekeeper = Gatekeeper(self.roster, self._writer.next_event + len(self._poses))
            commit = self._writer.append(
                chain(self._poses, _checked(events, gatekeeper)),
                note=note,
                command_id=command_id,
                sync=sync,
            )
            self._poses = []
            gatekeeper.settle(commit)
            if not gatekeeper.keeps_names:
                self._named = None
            self._roster = None if gatekeeper.has_retraction else gatekeeper.roster
            return Appended(commit)

    def find_command(self, command_id: bytes, *, everywhere: bool = False) -> Commit | None:
        """Return the commit that a command became, if it is stored.

        Args:
            command_id: 16 bytes.
            everywhere: Look in the whole log, not only in its last 10,000 commits or so.
        """
        with self._mutex:
            return self._writer.find(command_id, everywhere=everywhere)

    def sync(self) -> None:
        """Return once every commit so far survives a power cut."""
        with self._mutex:
            self._writer.sync()

    def add_door(
        self,
        *,
        x: float = NAN,
        y: float = NAN,
        theta: float = NAN,
        width: float = NAN,
        level: int = 0,
        state: DoorState | str = DoorState.UNKNOWN,
        prob_open: float = NAN,
        prob_closed: float = NAN,
        door_id: DoorId | None = None,
        name: str = "",
        **about: Unpack[About],
    ) -> DoorId:
        """Add a door and return its id: the next free one, unless given.

        Without x, y, theta and width it is an unplaced door: a sensor without geometry.

        Raises:
            DoorExistsError, DoorRemovedError: The id is taken, or was.
            InvalidEventError: A value that no door can have.
        """
        with self._mutex:
            given = self.roster.next_free_id if door_id is None else door_id
            added = DoorAdded(
                door_id=given,
                level=level,
                x=x,
                y=y,
                theta=theta,
                width=width,
                state=_state(state),
                prob_open=prob_open,
                prob_closed=prob_closed,
                happened_ns=self._happened(about),
            )
            events: list[Event] = [added]
            if name:
                events.append(
                    DoorAnnotated(
                        door_id=given, key="name", value=name, happened_ns=added.happened_ns
                    )
                )
            appended = self._commit(events, about)
            if appended.repeated:
                return self._added_by(appended.commit)
            return given

    def update_door(
        self,
        door: DoorId | str,
        *,
        x: float | None = None,
        y: float | None = None,
        theta: float | None = None,
        level: int | None = None,
        width: float | None = None,
        state: DoorState | str | None = None,
        prob_open: float | None = None,
        prob_closed: float | None = None,
        **about: Unpack[About],
    ) -> Appended:
        """Set the fields that are given; of a pose, the parts not given stay as they are.

        Raises:
            UnknownDoorError, DoorRemovedError: There is no such door.
            InvalidEventError: Nothing is given, or a value that no door can have.
        """
        with self._mutex:
            door_map = self._writer.state.door_map()
            known = door_map.doors[resolve_door(door, door_map)]
            changed = Changed(0)
            if not (x is y is theta is level is None):
                changed |= Changed.POSE
            for bit, value in (
                (Changed.WIDTH, width),
                (Changed.STATE, state),
                (Changed.PROB_OPEN, prob_open),
                (Changed.PROB_CLOSED, prob_closed),
            ):
                changed |= bit if value is not None else Changed(0)
            pose = bool(changed & Changed.POSE)
            event = DoorUpdated(
                door_id=known.door_id,
                changed=changed,
                level=known.level if level is None else level,
                x=known.x if pose and x is None else NAN if x is None else x,
                y=known.y if pose and y is None else NAN if y is None else y,
                theta=known.theta if pose and theta is None else NAN if theta is None else theta,
                width=NAN if width is None else width,
                state=DoorState.UNKNOWN if state is None else _state(state),
                prob_open=NAN if prob_open is None else prob_open,
                prob_closed=NAN if prob_closed is None else prob_closed,
                happened_ns=self._happened(about),
            )
            return self._commit([event], about)

    def remove_door(self, door: DoorId | str, **about: Unpack[About]) -> Appended:
        """Take a door out of the map; its history stays, its id is never used again."""
        event = DoorRemoved(door_id=self.resolve(door), happened_ns=self._happened(about))
        return self._commit([event], about)

    def observe(
        self,
        door: DoorId | str,
        state: DoorState | str,
        *,
        accuracy: float = 1.0,
        accuracy_open: float | None = None,
        accuracy_closed: float | None = None,
        opening: float = NAN,
        **about: Unpack[About],
    ) -> Appended:
        """Record that a sensor saw a door.

        Args:
            door: Id, name, or level/name.
            state: What it saw.
            accuracy: P(it reads right), [0.5, 1], for open and closed doors alike.
            accuracy_open: P(reads open | open), if it differs.
            accuracy_closed: P(reads closed | closed), if it differs.
            opening: How far the door stands open, 0..1.
            **about: When, who, why.
        """
        event = DoorObserved(
            door_id=self.resolve(door),
            state=_state(state),
            accuracy_open=accuracy if accuracy_open is None else accuracy_open,
            accuracy_closed=accuracy if accuracy_closed is None else accuracy_closed,
            opening=opening,
            happened_ns=self._happened(about),
        )
        return self._commit([event], about)

    def annotate(
        self, door: DoorId | str, key: str, value: str, **about: Unpack[About]
    ) -> Appended:
        """Say something about a door in words; an empty value takes it back."""
        event = DoorAnnotated(
            door_id=self.resolve(door), key=key, value=value, happened_ns=self._happened(about)
        )
        return self._commit([event], about)

    def request(
        self, door: DoorId | str, state: DoorState | str, **about: Unpack[About]
    ) -> Appended:
        """Record that somebody asked for a state; the door's state stays as it is."""
        event = DoorRequested(
            door_id=self.resolve(door), state=_state(state), happened_ns=self._happened(about)
        )
        return self._commit([event], about)

    def passed(
        self, door: DoorId | str, *, passed: bool = True, waited_s: float = NAN,
        **about: Unpack[About],
    ) -> Appended:  # fmt: skip
        """Record that a robot went through a door, or gave up waiting."""
        event = DoorPassed(
            door_id=self.resolve(door),
            passed=passed,
            waited_s=waited_s,
            happened_ns=self._happened(about),
        )
        return self._commit([event], about)

    def start_patrol(self, **about: Unpack[About]) -> tuple[Appended, int]:
        """Record that a round began; return its number, one more than the last one's."""
        with self._mutex:
            number = self._last_patrol(PatrolStarted) + 1
            event = PatrolStarted(patrol=number, happened_ns=self._happened(about))
            return self._commit([event], about), number

    def finish_patrol(self, **about: Unpack[About]) -> tuple[Appended, int]:
        """Record that the round that began last is over; return its number.

        Raises:
            CommandError: No round is under way.
        """
        with self._mutex:
            number = self._last_patrol(PatrolStarted)
            if number <= self._last_patrol(PatrolFinished):
                raise CommandError("no patrol round is under way; first: patrol LOG start.")
            event = PatrolFinished(patrol=number, happened_ns=self._happened(about))
            return self._commit([event], about), number

    def robot_pose(self, pose: RobotPose) -> None:
        """Keep a pose for the next commit; if none comes within a second, it gets its own."""
        with self._mutex:
            if pose.happened_ns is None:
                pose = RobotPose(
                    happened_ns=self._writer.clock.wall_ns(),
                    level=pose.level,
                    x=pose.x,
                    y=pose.y,
                    theta=pose.theta,
                    sd_xy=pose.sd_xy,
                    sd_theta=pose.sd_theta,
                )
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
                self._is_stale = True
                self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _commit(self, events: list[Event], about: About) -> Appended:
        note = Note(
            actor=about.get("actor", ""),
            source=about.get("source", ""),
            reason=about.get("reason", ""),
            correlation=about.get("correlation", ""),
        )
        return self.append(events, note=note, command_id=about.get("command_id"))

    def _happened(self, about: About) -> int | None:
        moment = self.moment(about.get("at"))
        if moment.event is not None:
            raise MomentError("when it happened is a time, not an event number.")
        return moment.ns

    def _last_patrol(self, kind: type[PatrolStarted | PatrolFinished]) -> int:
        """Return the greatest round number of that kind of event; 0: none."""
        batches = self.batches(kinds=[kind])
        return max((int(batch[kind]["patrol"].max()) for batch in batches), default=0)

    def _added_by(self, commit: Commit) -> DoorId:
        """Return the door that a commit, stored before, has added."""
        for number in range(commit.first_event, commit.last_event + 1):
            event = self.event(number).event
            if isinstance(event, DoorAdded):
                return event.door_id
        raise CommandError(f"the command of that id added no door (event {commit.first_event}).")

    def _write_poses(self) -> None:
        with self._mutex:
            if self._pose_timer is not None:
                self._pose_timer.cancel()
                self._pose_timer = None
            if self._poses:
                self._is_stale = True
                self._writer.append(self._poses)
                self._poses = []


def _checked(events: Iterable[Event], gatekeeper: Gatekeeper) -> Iterator[Event]:
    """Pass the events on, each once it is checked."""
    for event in events:
        gatekeeper.check(event)
        yield event


def _state(state: DoorState | str) -> DoorState:
    return DoorState.parse(state) if isinstance(state, str) else state
