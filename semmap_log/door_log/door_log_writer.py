"""The commands of a door map's log: each call is one commit, durable when it returns."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple, TypedDict, TypeVar

from semmap_log.common.texts import command_line
from semmap_log.domain.commits import Note
from semmap_log.domain.doors import NAN, DoorId, DoorState
from semmap_log.domain.events import (
    DoorAdded,
    DoorAnnotated,
    DoorEvent,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    DoorUpdated,
    Event,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    is_whole_number,
)
from semmap_log.domain.keywords import knows_its_keywords
from semmap_log.domain.meaning import Changed
from semmap_log.domain.moments import INSTANTS
from semmap_log.door_log.appendable_log import AppendableLog, Appended
from semmap_log.door_log.command_content import content_of
from semmap_log.door_log.door_log import Time
from semmap_log.door_log.retracting import check_can_retract
from semmap_log.errors import CommandError, InvalidEventError, MomentError

E = TypeVar("E", bound=Event)


class About(TypedDict, total=False):
    """The keywords that every verb takes besides its own, for who has them as a dictionary."""

    at: Time
    """When it happened; default: now. `2h ago` counts from now."""
    actor: str
    source: str
    reason: str
    correlation: str
    command_id: bytes | None
    """16 bytes: the same command, sent again, is stored once, and answered as the first time."""
    expected_event: int | None
    """Number of the last event that the caller knows, about the door or, for a new door or a round,
    in the log; -1: none. Another is an error, and nothing is written."""


class _About(NamedTuple):
    """What a verb was told besides its own arguments: when, who and why."""

    at: Time
    note: Note
    command_id: bytes | None
    expected_event: int | None


@knows_its_keywords
class DoorLogWriter(AppendableLog):
    """A log that is written, by the commands that a door map knows.

    Every verb also takes, by keyword: `at`, when it happened (default: now; `2h ago` counts from
    now); `actor`, `source`, `reason` and `correlation`, who did it, with what, why, and what it
    belongs to; `command_id`, 16 bytes, by which the same command, sent again, is stored once; and
    `expected_event`, the number of the last event that the caller knows, about the door or, for a
    new door or a round, in the log (-1: none): another is an error, and nothing is written.
    """

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
        at: Time = None,
        actor: str = "",
        source: str = "",
        reason: str = "",
        correlation: str = "",
        command_id: bytes | None = None,
        expected_event: int | None = None,
    ) -> DoorId:
        """Add a door and return its id: the next free one, unless given.

        Without x, y, theta and width it is an unplaced door: a sensor without geometry. Its level
        is told by number or name; None: the only one there is.

        Raises:
            DoorExistsError, DoorRemovedError: The id is taken, or was.
            UnknownLevelError: There is no such level, or there are several and none is told.
            InvalidEventError: A value that no door can have.
        """
        about = _About(at, _note(actor, source, reason, correlation), command_id, expected_event)

        def events() -> list[Event]:
            given = self.roster.next_free_id if door_id is None else door_id
            happened_ns = self._happened(about)
            meant = self.level_meant(level)
            added = DoorAdded(
                door_id=given,
                level=meant,
                x=x,
                y=y,
                theta=theta,
                width=width,
                state=_state(state),
                prob_open=prob_open,
                prob_closed=prob_closed,
                happened_ns=happened_ns,
            )
            if not name:
                return [added]
            self._check_unused(name, meant)
            named = DoorAnnotated(door_id=given, key="name", value=name, happened_ns=happened_ns)
            return [added, named]

        asked = ("add_door", door_id, level or 0, x, y, theta, width, _state(state), prob_open,
                 prob_closed, name)  # fmt: skip
        _, added = self._commit(events, about, DoorAdded, asked)
        return added.door_id

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
        at: Time = None,
        actor: str = "",
        source: str = "",
        reason: str = "",
        correlation: str = "",
        command_id: bytes | None = None,
        expected_event: int | None = None,
    ) -> Appended:
        """Set the fields that are given; of a pose, the parts not given stay as they are.

        Raises:
            UnknownDoorError, DoorRemovedError: There is no such door.
            UnknownLevelError: There is no level of that number or name.
            InvalidEventError: Nothing is given, or a value that no door can have.
        """
        about = _About(at, _note(actor, source, reason, correlation), command_id, expected_event)

        def event() -> DoorUpdated:
            door_id = self._resolve(door)
            known = self.state.door(door_id)
            if known is None:
                raise self.roster.absent(door_id)
            moved = not (x is y is theta is level is None)
            given = {
                Changed.POSE: moved,
                Changed.WIDTH: width is not None,
                Changed.STATE: state is not None,
                Changed.PROB_OPEN: prob_open is not None,
                Changed.PROB_CLOSED: prob_closed is not None,
            }
            changed = Changed(0)
            for bit, is_given in given.items():
                changed |= bit if is_given else Changed(0)
            return DoorUpdated(
                door_id=known.door_id,
                changed=changed,
                level=known.level if level is None else self.level_meant(level),
                x=(known.x if x is None else x) if moved else NAN,
                y=(known.y if y is None else y) if moved else NAN,
                theta=(known.theta if theta is None else theta) if moved else NAN,
                width=NAN if width is None else width,
                state=DoorState.UNKNOWN if state is None else _state(state),
                prob_open=NAN if prob_open is None else prob_open,
                prob_closed=NAN if prob_closed is None else prob_closed,
                happened_ns=self._happened(about),
            )

        meant = None if state is None else _state(state)
        asked = (door, x, y, theta, level, width, meant, prob_open, prob_closed)
        return self._commit_one(event, about, ("update_door", *asked))

    def remove_door(
        self,
        door: DoorId | str,
        *,
        at: Time = None,
        actor: str = "",
        source: str = "",
        reason: str = "",
        correlation: str = "",
        command_id: bytes | None = None,
        expected_event: int | None = None,
    ) -> Appended:
        """Take a door out of the map; its history stays, its id is never used again."""
        about = _About(at, _note(actor, source, reason, correlation), command_id, expected_event)
        return self._commit_one(
            lambda: DoorRemoved(door_id=self._resolve(door), happened_ns=self._happened(about)),
            about,
            ("remove_door", door),
        )

    def observe(
        self,
        door: DoorId | str,
        state: DoorState | str,
        *,
        accuracy: float = 1.0,
        accuracy_open: float | None = None,
        accuracy_closed: float | None = None,
        opening: float = NAN,
        at: Time = None,
        actor: str = "",
        source: str = "",
        reason: str = "",
        correlation: str = "",
        command_id: bytes | None = None,
        expected_event: int | None = None,
    ) -> Appended:
        """Record that a sensor saw a door.

        Args:
            door: Id, name, or level/name.
            state: What it saw.
            accuracy: P(it reads right), [0.5, 1], for open and closed doors alike.
            accuracy_open: P(reads open | open), if it differs.
            accuracy_closed: P(reads closed | closed), if it differs.
            opening: How far the door stands open, 0..1.
            at: When it happened; default: now.
            actor: Who did it.
            source: Which sensor, robot or file.
            reason: Why.
            correlation: What it belongs to.
            command_id: 16 bytes: the same command, sent again, is stored once.
            expected_event: Number of the last event about the door, as the caller knows it.
        """
        about = _About(at, _note(actor, source, reason, correlation), command_id, expected_event)
        seen = _state(state)
        return self._commit_one(
            lambda: DoorObserved(
                door_id=self._resolve(door),
                state=seen,
                accuracy_open=accuracy if accuracy_open is None else accuracy_open,
                accuracy_closed=accuracy if accuracy_closed is None else accuracy_closed,
                opening=opening,
                happened_ns=self._happened(about),
            ),
            about,
            ("observe", door, seen, accuracy, accuracy_open, accuracy_closed, opening),
        )

    def annotate(
        self,
        door: DoorId | str,
        key: str,
        value: str,
        *,
        at: Time = None,
        actor: str = "",
        source: str = "",
        reason: str = "",
        correlation: str = "",
        command_id: bytes | None = None,
        expected_event: int | None = None,
    ) -> Appended:
        """Say something about a door in words; an empty value takes it back."""
        about = _About(at, _note(actor, source, reason, correlation), command_id, expected_event)

        def event() -> DoorAnnotated:
            door_id = self._resolve(door)
            if key == "name" and value:
                self._check_unused(value, self.level_of(door_id), but=door_id)
            return DoorAnnotated(
                door_id=door_id, key=key, value=value, happened_ns=self._happened(about)
            )

        return self._commit_one(event, about, ("annotate", door, key, value))

    def request(
        self,
        door: DoorId | str,
        state: DoorState | str,
        *,
        at: Time = None,
        actor: str = "",
        source: str = "",
        reason: str = "",
        correlation: str = "",
        command_id: bytes | None = None,
        expected_event: int | None = None,
    ) -> Appended:
        """Record that somebody asked for a state; the door's state stays as it is."""
        about = _About(at, _note(actor, source, reason, correlation), command_id, expected_event)
        wanted = _state(state)
        return self._commit_one(
            lambda: DoorRequested(
                door_id=self._resolve(door), state=wanted, happened_ns=self._happened(about)
            ),
            about,
            ("request", door, wanted),
        )

    def passed(
        self,
        door: DoorId | str,
        *,
        passed: bool = True,
        waited_s: float = NAN,
        at: Time = None,
        actor: str = "",
        source: str = "",
        reason: str = "",
        correlation: str = "",
        command_id: bytes | None = None,
        expected_event: int | None = None,
    ) -> Appended:
        """Record that a robot went through a door, or gave up waiting."""
        about = _About(at, _note(actor, source, reason, correlation), command_id, expected_event)
        return self._commit_one(
            lambda: DoorPassed(
                door_id=self._resolve(door),
                passed=passed,
                waited_s=waited_s,
                happened_ns=self._happened(about),
            ),
            about,
            ("passed", door, passed, waited_s),
        )

    def retract(
        self,
        first: int,
        last: int | None = None,
        *,
        at: Time = None,
        actor: str = "",
        source: str = "",
        reason: str = "",
        correlation: str = "",
        command_id: bytes | None = None,
        expected_event: int | None = None,
    ) -> Appended:
        """Take events back: every question asked with knowledge after this leaves them out.

        They stay in the log: `known_at` before this still shows them, `history` marks them. A door
        whose DoorAdded is taken back is gone; its id is not used again.

        Args:
            first: Number of the first event.
            last: Number of the last, inclusive; None: only the first. Retractions in between, and
                what is taken back already, stay as they are.
            at: When it happened; default: now.
            actor: Who did it.
            source: Which sensor, robot or file.
            reason: Why.
            correlation: What it belongs to.
            command_id: 16 bytes: the same command, sent again, is stored once.
            expected_event: Number of the last event of the log, as the caller knows it.

        Raises:
            CommandError: There is no such event, the range runs backwards, or nothing in it can be
                taken back.
        """
        about = _About(at, _note(actor, source, reason, correlation), command_id, expected_event)
        last = first if last is None else last

        def event() -> Retracted:
            check_can_retract(self.reader, first, last)
            return Retracted(first_event=first, last_event=last, happened_ns=self._happened(about))

        return self._commit_one(event, about, ("retract", first, last))

    def start_patrol(
        self,
        *,
        at: Time = None,
        actor: str = "",
        source: str = "",
        reason: str = "",
        correlation: str = "",
        command_id: bytes | None = None,
        expected_event: int | None = None,
    ) -> tuple[Appended, int]:
        """Record that a round began; return its number, one more than the last one's."""
        about = _About(at, _note(actor, source, reason, correlation), command_id, expected_event)

        def events() -> list[Event]:
            number = self._last_patrol(PatrolStarted) + 1
            return [PatrolStarted(patrol=number, happened_ns=self._happened(about))]

        appended, started = self._commit(events, about, PatrolStarted, ("start_patrol",))
        return appended, started.patrol

    def finish_patrol(
        self,
        *,
        at: Time = None,
        actor: str = "",
        source: str = "",
        reason: str = "",
        correlation: str = "",
        command_id: bytes | None = None,
        expected_event: int | None = None,
    ) -> tuple[Appended, int]:
        """Record that the round that began last is over; return its number.

        Raises:
            CommandError: No round is under way.
        """
        about = _About(at, _note(actor, source, reason, correlation), command_id, expected_event)

        def events() -> list[Event]:
            number = self._last_patrol(PatrolStarted)
            if number <= self._last_patrol(PatrolFinished):
                line = command_line("patrol", self.path, "start")
                raise CommandError(f"no patrol round is under way; to begin one: {line}")
            return [PatrolFinished(patrol=number, happened_ns=self._happened(about))]

        appended, finished = self._commit(events, about, PatrolFinished, ("finish_patrol",))
        return appended, finished.patrol

    def _commit_one(
        self, make: Callable[[], Event], about: _About, asked: tuple[object, ...]
    ) -> Appended:
        return self._commit(lambda: [make()], about, Event, asked)[0]

    def _commit(
        self,
        make: Callable[[], Iterable[Event]],
        about: _About,
        kind: type[E],
        asked: tuple[object, ...],
    ) -> tuple[Appended, E]:
        """Append what `make` gives, once, and return its first event of that kind.

        Args:
            make: Called if the command is not stored yet.
            about: When, who, why.
            kind: Of the event that is wanted.
            asked: The command in words: what tells it from another of the same id.

        Raises:
            CommandReusedError: The command was stored before, and was another.
            UnexpectedEventError: The door, or the log, went on since the caller looked.
        """
        made: list[Event] = []

        def remembered() -> list[Event]:
            made.extend(make())
            self._check_expected(about.expected_event, made[0])
            return made

        content = content_of(*asked, about.at, about.note)
        appended = self._append_once(
            remembered,
            about.note,
            about.command_id,
            content,
            lambda stored: stored.content == content,
        )
        if appended.repeated:
            made += self._stored(appended.commit)
        return appended, next(event for event in made if isinstance(event, kind))

    def _check_expected(self, expected: int | None, event: Event) -> None:
        """Return if the last event is as expected: of the door it is about, else of the log.

        Raises:
            UnexpectedEventError: It is another.
        """
        if expected is None:
            return
        if isinstance(event, DoorEvent) and not isinstance(event, DoorAdded):
            last = self.state.last_event(event.door_id)
            self._check_last_event(f"door {event.door_id}", expected, last)
        else:
            self._check_last_event("the log", expected, self._writer.next_event - 1)

    def _check_unused(self, name: str, level: int, *, but: DoorId | None = None) -> None:
        """Return if no other door of the level bears the name.

        Raises:
            CommandError: One does; then the name would mean neither.
        """
        for door in self.state.door_map().doors.values():
            if (door.name, door.level) == (name, level) and door.door_id != but:
                raise CommandError(
                    f"door {door.door_id} of that level is called {name!r} already; "
                    "choose another name."
                )

    def _happened(self, about: _About) -> int | None:
        """Return when a command says that it happened; what is relative counts from now."""
        if about.at is None:
            return None
        moment = self.moment(about.at, now_ns=self.now_ns())
        if moment.event is not None:
            raise MomentError(
                f"expected when it happened, a time such as {INSTANTS}; got the number of event "
                f"{moment.event}, of whose time `show` tells."
            )
        return moment.ns

    def _last_patrol(self, kind: type[PatrolStarted | PatrolFinished]) -> int:
        """Return the greatest round number of that kind of event; 0: none."""
        batches = self.batches(kinds=[kind])
        return max((int(batch[kind]["patrol"].max()) for batch in batches), default=0)


def _note(actor: str, source: str, reason: str, correlation: str) -> Note:
    if actor == source == reason == correlation == "":
        return _NO_NOTE
    return Note(actor, source, reason, correlation)


_NO_NOTE = Note()


def _state(state: DoorState | str) -> DoorState:
    """Return the state that a caller means; `True` and 1.0 mean none, though they equal OPEN.

    Raises:
        InvalidEventError: It is none.
    """
    try:
        if isinstance(state, str):
            return DoorState.parse(state)
        if is_whole_number(state):
            return DoorState(state)
    except ValueError:
        pass
    raise InvalidEventError("state", f"one of {' '.join(DoorState.__members__)}", state)
