"""A log that is written: queried like any other, and appended to, one commit at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType, TracebackType
from typing import TYPE_CHECKING, Final, TypeAlias, TypedDict, TypeVar

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_index import DoorIndex
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.io.progress import Progress
from semmap_log.core.model import events as ev
from semmap_log.core.model.commits import NO_CONTENT, Commit, Note
from semmap_log.core.model.doors import NAN, DoorId, DoorMap, DoorState, Geometry, split_words
from semmap_log.core.model.keywords import check_keywords
from semmap_log.core.model.moments import Time
from semmap_log.errors import InvalidEventError
from semmap_log.log.door_log import current_map
from semmap_log.log.door_log.appender import Appended, Appender
from semmap_log.log.door_log.door_commands import (
    AddDoor,
    AnnotateDoor,
    DefineClass,
    FinishPatrol,
    ObserveDoor,
    PassDoor,
    PinMoment,
    RemoveDoor,
    RequestDoor,
    RetractEvents,
    StartPatrol,
    UpdateDoor,
    door_meant,
    level_of,
)
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.door_log.known_past import KnownPast
from semmap_log.log.replay.replay import Scope
from semmap_log.log.replay.written_state import WrittenState
from semmap_log.store.gone_commands import StoredCommand
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing.durability import DurabilityPolicy
from semmap_log.store.writing.writer_opening import OpenedLog

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from semmap_log.core.model.rigid_transform import RigidTransform

E = TypeVar("E", bound=ev.Event)
Measured: TypeAlias = "tuple[float, float, float] | tuple[float, float, float, float]"
"""Where a door lies, as somebody measured it: x, y, theta and, if it was measured, the width."""


class About(TypedDict, total=False):
    """The keywords that every verb takes besides its own; `DoorLogWriter` says what each is."""

    at: Time
    actor: str
    source: str
    reason: str
    correlation: str
    command_id: bytes | None
    expected_event: int | None


_NOT_GIVEN: Final[About] = {
    "at": None,
    "actor": "",
    "source": "",
    "reason": "",
    "correlation": "",
    "command_id": None,
    "expected_event": None,
}


class DoorLogWriter(DoorLog):
    """A log that is written, by the commands that a door map knows. Several threads may use it.

    Every verb also takes, by keyword: `at`, when it happened (default: now; `2h ago` counts from
    now); `actor`, `source`, `reason` and `correlation`, who did it, with what, why, and what it
    belongs to; `command_id`, 16 bytes, by which the same command, sent again, is stored once; and
    `expected_event`, the number of the last event that the caller knows, about the door or, for a
    new door or a round, in the log (-1: none): another is an error, and nothing is written.
    """

    def __init__(self, opened: OpenedLog[WrittenState]) -> None:
        super().__init__(opened.reader)
        self._writer = opened.writer
        self._appender = Appender(opened)

    def add_door(
        self,
        *,
        x: float = NAN,
        y: float = NAN,
        theta: float = NAN,
        width: float = NAN,
        level: int | str | None = None,
        state: DoorState | str = DoorState.UNKNOWN,
        prob_open: float = NAN,
        prob_closed: float = NAN,
        door_id: DoorId | None = None,
        name: str = "",
        object_class: str = "",
        outline: Sequence[tuple[float, float]] = (),
        **about: Unpack[About],
    ) -> DoorId:
        """Add a door and return its id: the next free one, unless given.

        Without x, y, theta and width it is an unplaced door: a sensor without geometry. Its level
        is given by number or name; None: the only one there is. With an `object_class` it is an
        object of that class; a polygon needs an `outline`, the corners (x, y) in metres, frame
        `map`, and lies at the first of them, unless x and y are given.

        Raises:
            DoorExistsError, DoorRemovedError: The id is taken, or was.
            UnknownLevelError: There is no such level, or there are several and none is given.
            CommandError: There is no such class, or its objects do not look like that.
            InvalidEventError: A value that no door can have.
        """
        corners = tuple((float(x), float(y)) for x, y in outline)
        command = AddDoor(_context(self.add_door, about), door_id, level, x, y, theta, width,
                          _state(state), prob_open, prob_closed, name, object_class,
                          corners)  # fmt: skip
        return _first_of(ev.DoorAdded, self._appender.append(command)).door_id

    def define_class(
        self,
        name: str,
        *,
        geometry: Geometry | str = Geometry.SEGMENT,
        states: str = "OPEN,CLOSED,MOVING",
        blocks: str | None = None,
        **about: Unpack[About],
    ) -> Appended:
        """Define what objects of a class are like; an earlier definition of it counts no more.

        Args:
            name: What the class is called, such as dock.
            geometry: What an object covers of the floor: segment, polygon or point.
            states: Its words for OPEN, CLOSED and, if it has a third, MOVING: `free,taken`.
            blocks: Those of the words whose states block a robot's way; empty: none; None: that
                for CLOSED.
            **about: When, who and why: see the class.

        Raises:
            InvalidEventError: A value that no class can have.
        """
        shape = geometry.value if isinstance(geometry, Geometry) else geometry
        if blocks is None:
            blocks = ",".join(split_words(states)[1:2])
        return self._appender.append(
            DefineClass(_context(self.define_class, about), name, shape, states, blocks)
        )

    def update_door(
        self,
        door: DoorId | str,
        *,
        x: float | None = None,
        y: float | None = None,
        theta: float | None = None,
        level: int | str | None = None,
        width: float | None = None,
        state: DoorState | str | None = None,
        prob_open: float | None = None,
        prob_closed: float | None = None,
        **about: Unpack[About],
    ) -> Appended:
        """Set the fields that are given; of a pose, the parts not given stay as they are.

        Raises:
            UnknownDoorError, DoorRemovedError: There is no such door.
            UnknownLevelError: There is no level of that number or name.
            InvalidEventError: Nothing is given, or a value that no door can have.
        """
        wanted = None if state is None else _state(state)
        command = UpdateDoor(_context(self.update_door, about), door, x, y, theta, level, width,
                             wanted, prob_open, prob_closed)  # fmt: skip
        return self._appender.append(command)

    def remove_door(
        self,
        door: DoorId | str,
        **about: Unpack[About],
    ) -> Appended:
        """Take a door out of the map; its history stays, its id is never used again."""
        return self._appender.append(RemoveDoor(_context(self.remove_door, about), door))

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
            **about: When, who and why: see the class.
        """
        command = ObserveDoor(_context(self.observe, about), door, _state(state), accuracy,
                              accuracy_open, accuracy_closed, opening)  # fmt: skip
        return self._appender.append(command)

    def annotate(
        self,
        door: DoorId | str,
        key: str,
        value: str,
        **about: Unpack[About],
    ) -> Appended:
        """Say something about a door in words; an empty value takes it back."""
        return self._appender.append(AnnotateDoor(_context(self.annotate, about), door, key, value))

    def request(
        self,
        door: DoorId | str,
        state: DoorState | str,
        **about: Unpack[About],
    ) -> Appended:
        """Record that a state was requested; the door's state stays as it is."""
        return self._appender.append(
            RequestDoor(_context(self.request, about), door, _state(state))
        )

    def passed(
        self,
        door: DoorId | str,
        *,
        passed: bool = True,
        waited_s: float = NAN,
        **about: Unpack[About],
    ) -> Appended:
        """Record that a robot went through a door, or gave up waiting."""
        return self._appender.append(PassDoor(_context(self.passed, about), door, passed, waited_s))

    def retract(
        self,
        first: int,
        last: int | None = None,
        **about: Unpack[About],
    ) -> Appended:
        """Take events back: every query whose knowledge includes this leaves them out.

        They stay in the log: `known_at` before this still shows them, `history` marks them. A door
        whose DoorAdded is taken back is gone; its id is not used again.

        Args:
            first: Number of the first event.
            last: Number of the last, inclusive; None: only the first. Retractions in between, and
                what is taken back already, stay as they are.
            **about: When, who and why: see the class.

        Raises:
            CommandError: There is no such event, the range runs backwards, or nothing in it can be
                taken back.
        """
        command = RetractEvents(
            _context(self.retract, about), first, first if last is None else last
        )
        return self._appender.append(command)

    def pin(self, name: str, **about: Unpack[About]) -> Appended:
        """Give a moment a name, `pin:NAME`, by which it stays answerable: see `retain`.

        Args:
            name: What it is called; a moment that was called so before has no name any more.
            **about: Who and why, as the class says; `at` is the moment (default: now).

        Raises:
            MomentError: A time that cannot be read.
            HorizonError: It cannot be answered any more.
        """
        at = about.get("at")
        self.replay(at=at)
        return self._appender.append(PinMoment(_context(self.pin, about), name, self.instant(at)))

    def rebase(
        self,
        floor: ev.FloorMap,
        *,
        by: RigidTransform | tuple[float, float, float],
        doors: Mapping[DoorId | str, Measured] = MappingProxyType({}),
        level: int | str | None = None,
        **about: Unpack[About],
    ) -> Appended:
        """Give a level a new map, and its doors their places in it, as one commit.

        What happened before stays on the old map. Reports from later times are taken to be in the
        new one already, so that `at` may be the time when the robot began to use it. Doors
        without a place, and those of other levels, stay as they are.

        Args:
            floor: The new map; `interop.formats.files.map_server.read_map` reads a map_server's.
            by: From the old map's frame to the new one's: (dx, dy, theta), metres and radians;
                `core.folds.rebasing.fit_maps` finds it from points that were measured in both.
            doors: Doors that were measured in the new map, (x, y, theta) or (x, y, theta, width):
                there the transform does not count.
            level: Its number or name; None: the only one there is.
            **about: When, who and why: see the class.

        Raises:
            CommandError: The level has this very map already, or another from a later time.
            UnknownDoorError: A measured door is not known.
            UnknownLevelError: There is no such level, or there are several and none is given.
        """
        from semmap_log.core.folds.rebasing import MeasuredDoor
        from semmap_log.core.model.rigid_transform import RigidTransform
        from semmap_log.log.door_log.door_commands import RebaseMap

        transform = by if isinstance(by, RigidTransform) else RigidTransform(*by)
        measured = {door: MeasuredDoor(*at) for door, at in doors.items()}
        command = RebaseMap(_context(self.rebase, about), floor, transform, measured, level)
        return self._appender.append(command)

    def start_patrol(
        self,
        **about: Unpack[About],
    ) -> tuple[Appended, int]:
        """Record that a round began; return its number, one more than the last one's."""
        appended = self._appender.append(StartPatrol(_context(self.start_patrol, about)))
        return appended, _first_of(ev.PatrolStarted, appended).patrol

    def finish_patrol(
        self,
        **about: Unpack[About],
    ) -> tuple[Appended, int]:
        """Record that the round that began last is over; return its number.

        Raises:
            CommandError: No round is under way.
        """
        appended = self._appender.append(FinishPatrol(_context(self.finish_patrol, about)))
        return appended, _first_of(ev.PatrolFinished, appended).patrol

    def append(
        self,
        events: current_map.Events,
        *,
        note: Note = Note(),
        command_id: bytes | None = None,
        content: bytes = NO_CONTENT,
        expected_event: int | None = None,
        sync: bool | None = None,
    ) -> Appended:
        """Append events as one commit, all or none; waiting robot poses go before them.

        Args:
            events: At least one: events, batches of them as columns, or a batch. Of many, give a
                generator of batches: they are written as they come, in memory of about one chunk.
            note: Who, with what, why.
            command_id: 16 bytes; a command that is stored already is not stored again.
            content: Digest of what the command asks for (`content_of`), if the same command may
                come with other events; default: the events themselves are compared.
            expected_event: The number of the log's last event (-1: none), as the caller knows it.
            sync: Whether to return only when it survives a power cut; default: as the log's
                durability says.

        Raises:
            InvalidEventError: A batch holds a value that no event can have; as for:
            CommandError: The map forbids an event; nothing is stored.
            CommandReusedError: The command is stored already, with other events.
            UnexpectedEventError: The log went on since.
            LogPoisonedError: A write failed; the outcome is unknown until the log is reopened.
        """
        context = current_map.CommandContext(None, note, command_id, expected_event)
        return self._appender.append(
            current_map.GivenEvents.of(events, context, content), sync=sync
        )

    def append_made(
        self,
        make: Callable[[], list[ev.Event]],
        *,
        note: Note = Note(),
        command_id: bytes | None = None,
        content: bytes = NO_CONTENT,
    ) -> Appended | None:
        """Append what `make` returns, as one commit; no other append comes in between.

        Args:
            make: Asks this log what it wants, and gives the events, or none where what it finds
                needs no change; not called for a command that is stored already.
            note: Who, with what, why.
            command_id: 16 bytes; a command that is stored already is not stored again.
            content: Digest of what the command asks for.

        Returns:
            None where there was nothing to append; what `make` looked at is durable, as promised.

        Raises:
            CommandError: The map forbids an event; nothing is stored.
            CommandReusedError: The command is stored already, with other content.
            LogPoisonedError: A write failed; the outcome is unknown until the log is reopened.
        """
        context = current_map.CommandContext(None, note, command_id)
        return self._appender.append_if_any(current_map.LazyEvents(context, make, content))

    def sync(self) -> None:
        """Return once every commit so far survives a power cut."""
        self._writer.sync()

    def take_over(
        self,
        make: Callable[[int], Iterable[ev.Event | EventBatch]],
        *,
        note: Note,
        command_id: bytes,
        content: bytes,
        are_facts: bool = True,
        recorded_ns: int | None = None,
    ) -> Commit:
        """Append a commit of another log as it was there; `sync` makes it last.

        Args:
            make: Returns the events; called with the number that the first of them gets.
            note: Who, with what, why.
            command_id: 16 bytes; who calls has seen that it is not stored.
            content: Digest of what the command requested.
            are_facts: The other log took them: only what this log could not hold is refused.
            recorded_ns: When the other log recorded it; None: it is recorded now. Later than the
                log's end, or the log ends there.

        Raises:
            CommandError: The map forbids an event; nothing of the commit is stored.
            LogPoisonedError: A write failed; the outcome is unknown until the log is reopened.
        """
        command = current_map.ImportedCommit(
            current_map.CommandContext(None, note, command_id), make, content
        )
        return self._appender.take_over(command, are_facts=are_facts, recorded_ns=recorded_ns)

    def begin_at(self, recorded_ns: int) -> bool:
        """Let a log without events begin at that moment, so that it can take over another's times.

        Returns:
            False: it has events, or had; nothing was done.

        Raises:
            LogPoisonedError: It could not be written.
        """
        return self._appender.begin_at(recorded_ns)

    def find_command(self, command_id: bytes) -> Commit | None:
        """Return the commit that a command became, if it is stored, however long ago.

        Args:
            command_id: 16 bytes.

        Raises:
            CorruptLogError: A segment in which it may be is damaged.
        """
        found = self.find_stored(command_id)
        return None if found is None else found.commit

    def find_stored(self, command_id: bytes) -> StoredCommand | None:
        """Return a command, if it is stored, also if its events were taken out since.

        Args:
            command_id: 16 bytes.

        Raises:
            CorruptLogError: A segment in which it may be is damaged.
        """
        return self._appender.find_command(command_id)

    def robot_pose(self, pose: ev.RobotPose) -> None:
        """Keep a pose for the next commit; if none comes within a second, it gets its own.

        Raises:
            UnknownLevelError: It states no level, and the log has several.
        """
        self._appender.add_pose(pose)

    @property
    def _reader(self) -> LogReader:
        """The bytes underneath, with all that was written so far."""
        return self._appender.now.reader

    def refresh(self) -> None:
        """Read the log's folder again; what this object writes is seen without it."""
        self._appender.now.refresh()

    @property
    def state(self) -> DoorMapState:
        """The door map after the last commit, as the writer holds it."""
        return self._appender.now.state

    def state_in(self, scope: Scope = Scope(), *, progress: Progress | None = None) -> DoorMapState:
        """Return the fold of a scope: as of a log that is read; of now, without reading it."""
        if scope != Scope():
            return super().state_in(scope, progress=progress)
        return DoorMapState.from_arrays(self.state.to_arrays())

    def door_map(self) -> DoorMap:
        """Return the doors after the last commit as values, whatever is appended meanwhile."""
        return self._appender.now.door_map()

    @property
    def door_index(self) -> DoorIndex:
        """Which doors and levels there are after the last commit."""
        return self._appender.now.door_index

    @property
    def known_past(self) -> KnownPast:
        """What the log still holds of its past: checks new events against it."""
        return self._appender.now.past

    @property
    def policy(self) -> DurabilityPolicy:
        """What is promised of an append when it returns."""
        return self._writer.policy

    @property
    def durable_before(self) -> int:
        """Events below this number survive a power cut."""
        return self._writer.durable_before

    def end_ns(self) -> int:
        """Return the log's end: the latest happened time in it; 0 for a log without events."""
        return self.state.latest_happened_ns

    def now_ns(self) -> int:
        """Return what the log's clock says: nanoseconds since 1970, UTC."""
        return self._appender.now.now_ns()

    def resolve(self, door: str | int) -> DoorId:
        """Return the door of that id, name, or level/name, as of now."""
        return door_meant(door, self._appender.now)

    def level_meant(self, level: int | str | None) -> int:
        """Return the level that a caller means, as of now: as `DoorIndex.level_meant`."""
        return self._appender.now.level_meant(level)

    def level_of(self, door: DoorId) -> int:
        """Return the level that a door is on; 0 for one that is not there."""
        return level_of(door, self._appender.now)

    def close(self) -> None:
        """Write what waits, close the segment so that every tool reads it, let the lock go."""
        self._appender.close()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _first_of(kind: type[E], appended: Appended) -> E:
    """Return the first event of a kind that was appended, or was stored before."""
    return next(event for event in appended.events if isinstance(event, kind))


def _context(verb: Callable[..., object], about: About) -> current_map.CommandContext:
    if not about:
        return _NOTHING_TOLD
    check_keywords(verb, about, About)
    whole = _NOT_GIVEN | about
    said = (whole["actor"], whole["source"], whole["reason"], whole["correlation"])
    note = Note(*said) if any(said) else Note()
    return current_map.CommandContext(
        whole["at"], note, whole["command_id"], whole["expected_event"]
    )


_NOTHING_TOLD = current_map.CommandContext()


def _state(state: DoorState | str) -> DoorState | str:
    """Return the state that a caller means, or what a class may have for a word for it.

    `True` and 1.0 mean none, though they equal OPEN.

    Raises:
        InvalidEventError: It is no state.
    """
    try:
        if isinstance(state, str):
            return DoorState.__members__.get(state.strip().upper(), state)
        if ev.is_whole_number(state):
            return DoorState(state)
    except ValueError:
        pass
    raise InvalidEventError("state", f"one of {' '.join(DoorState.__members__)}", state)
