"""The commands that a door map knows: one for each verb of `DoorLogWriter`.

A repeated command is recognised by a digest of its words, since their meaning (a name, the next
free id) may have changed meanwhile. The words, and their order, never change.

Also the command that gives a level a new map.
"""

from __future__ import annotations

import hashlib
from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.rebasing import MapStates, MeasuredDoor, plan_rebase
from semmap_log.core.model import events as ev
from semmap_log.core.model.commits import content_of
from semmap_log.core.model.doors import CLASS, DOOR, OUTLINE, Corners, DoorId, DoorState
from semmap_log.core.model.meaning import PART_OF, Changed, changed
from semmap_log.core.model.rigid_transform import RigidTransform
from semmap_log.core.texts import command_line
from semmap_log.errors import CommandError
from semmap_log.log.door_log import current_map
from semmap_log.log.door_log.last_patrol import last_patrol
from semmap_log.log.replay.replay import Scope, replay
from semmap_log.log.replay.state import kept_pin
from semmap_log.store.reading.reader import LogReader


@dataclass(frozen=True, slots=True)
class WordedCommand(current_map.Command):
    """A command that is known by its words."""

    @property
    def content(self) -> bytes:
        """Digest of its words, when it happened, who and why."""
        return content_of(*self.words(), self.context.at, self.context.note)

    @abstractmethod
    def words(self) -> tuple[object, ...]:
        """Return the verb, and what it was given."""

    def _happened(self, now: current_map.CurrentMap) -> int | None:
        """Return when it happened; None: when it is recorded."""
        return None if self.context.at is None else now.happened_ns(self.context.at)


@dataclass(frozen=True, slots=True)
class DoorCommand(WordedCommand):
    """A command about a door that is there; its first event is about that door."""

    door: DoorId | str

    def door_expected(self, events: Iterable[ev.Event | EventBatch]) -> DoorId | None:
        """Return the door: `expected_event` is the last about it."""
        first = next(iter(events))
        assert isinstance(first, ev.DoorEvent)
        return first.door_id


@dataclass(frozen=True, slots=True)
class AddDoor(WordedCommand):
    """A door is to be in the map; None as its id: the next free one."""

    door_id: DoorId | None
    level: int | str | None
    x: float
    y: float
    theta: float
    width: float
    state: DoorState | str
    prob_open: float
    prob_closed: float
    name: str
    object_class: str = ""
    """What it is; empty: a door."""
    outline: Corners = ()

    def words(self) -> tuple[object, ...]:
        """Return the verb, and what it was given."""
        door = ("add_door", self.door_id, self.level or 0, self.x, self.y, self.theta, self.width,
                self.state, self.prob_open, self.prob_closed, self.name)  # fmt: skip
        return (*door, self.object_class, self.outline) if self.object_class else door

    def events(self, now: current_map.CurrentMap) -> list[ev.Event]:
        """Return its adding, its name and, if it is no door, what it is.

        Raises:
            CommandError: Another door of the level bears the name, or no class is called so.
        """
        given = now.door_index.next_free_id if self.door_id is None else self.door_id
        happened_ns = self._happened(now)
        meant = now.level_meant(self.level)
        kind = current_map.class_meant(self.object_class, now)
        place, outline = current_map.NewPlace(self.x, self.y, self.theta, self.width).of(
            kind, self.outline
        )
        added = ev.DoorAdded(
            door_id=given,
            level=meant,
            x=place.x,
            y=place.y,
            theta=place.theta,
            width=place.width,
            state=current_map.state_meant(self.state, kind),
            prob_open=self.prob_open,
            prob_closed=self.prob_closed,
            happened_ns=happened_ns,
        )
        if self.name:
            _check_unused(now, self.name, meant)
        said = {"name": self.name, CLASS: "" if kind.is_door else kind.name, OUTLINE: outline}
        return [
            *current_map.earlier_definition(kind, happened_ns, now),
            added,
            *(
                ev.DoorAnnotated(door_id=given, key=key, value=value, happened_ns=happened_ns)
                for key, value in said.items()
                if value
            ),
        ]


@dataclass(frozen=True, slots=True)
class DefineClass(WordedCommand):
    """Objects of a class are to be like that."""

    name: str
    geometry: str
    states: str
    blocks: str

    def words(self) -> tuple[object, ...]:
        """Return the verb, and what it was given."""
        return ("define_class", self.name, self.geometry, self.states, self.blocks)

    def events(self, now: current_map.CurrentMap) -> list[ev.Event]:
        """Return the definition."""
        return [
            ev.ClassDefined(
                class_name=self.name,
                geometry=self.geometry,
                states=self.states,
                blocks=self.blocks,
                happened_ns=self._happened(now),
            )
        ]


@dataclass(frozen=True, slots=True)
class UpdateDoor(DoorCommand):
    """Some values of a door are to be others; None: it stays as it is."""

    x: float | None
    y: float | None
    theta: float | None
    level: int | str | None
    width: float | None
    state: DoorState | str | None
    prob_open: float | None
    prob_closed: float | None

    def words(self) -> tuple[object, ...]:
        """Return the verb, and what it was given."""
        return ("update_door", self.door, self.x, self.y, self.theta, self.level, self.width,
                self.state, self.prob_open, self.prob_closed)  # fmt: skip

    def events(self, now: current_map.CurrentMap) -> list[ev.Event]:
        """Return the update; of a pose, the parts not given are those that the door has.

        Raises:
            CommandError: The door is not there.
        """
        door_id = door_meant(self.door, now)
        known = now.state.door(door_id)
        if known is None:
            raise now.door_index.absent(door_id)
        given = {name: value for name in PART_OF if (value := getattr(self, name)) is not None}
        if self.state is not None:
            given["state"] = current_map.state_meant(self.state, known.object_class)
        parts = changed(given)
        if parts & Changed.POSE:
            given = {"x": known.x, "y": known.y, "theta": known.theta} | given
        given["level"] = known.level if self.level is None else now.level_meant(self.level)
        happened_ns = self._happened(now)
        return [ev.DoorUpdated(door_id=door_id, changed=parts, happened_ns=happened_ns, **given)]


@dataclass(frozen=True, slots=True)
class RemoveDoor(DoorCommand):
    """A door is to be out of the map."""

    def words(self) -> tuple[object, ...]:
        """Return the verb, and what it was given."""
        return ("remove_door", self.door)

    def events(self, now: current_map.CurrentMap) -> list[ev.Event]:
        """Return its removal."""
        door_id = door_meant(self.door, now)
        return [ev.DoorRemoved(door_id=door_id, happened_ns=self._happened(now))]


@dataclass(frozen=True, slots=True)
class ObserveDoor(DoorCommand):
    """A sensor saw a door; None as an accuracy for open or closed doors: as `accuracy` says."""

    state: DoorState | str
    accuracy: float
    accuracy_open: float | None
    accuracy_closed: float | None
    opening: float

    def words(self) -> tuple[object, ...]:
        """Return the verb, and what it was given."""
        return ("observe", self.door, self.state, self.accuracy, self.accuracy_open,
                self.accuracy_closed, self.opening)  # fmt: skip

    def events(self, now: current_map.CurrentMap) -> list[ev.Event]:
        """Return the sighting."""
        accuracy, is_open, is_closed = self.accuracy, self.accuracy_open, self.accuracy_closed
        door_id = door_meant(self.door, now)
        return [
            ev.DoorObserved(
                door_id=door_id,
                state=current_map.state_meant(self.state, current_map.class_of(door_id, now)),
                accuracy_open=accuracy if is_open is None else is_open,
                accuracy_closed=accuracy if is_closed is None else is_closed,
                opening=self.opening,
                happened_ns=self._happened(now),
            )
        ]


@dataclass(frozen=True, slots=True)
class AnnotateDoor(DoorCommand):
    """Sets a text of a door under a key."""

    key: str
    value: str

    def words(self) -> tuple[object, ...]:
        """Return the verb, and what it was given."""
        return ("annotate", self.door, self.key, self.value)

    def events(self, now: current_map.CurrentMap) -> list[ev.Event]:
        """Return the annotation.

        Raises:
            CommandError: It is a name that another door of the level bears, or no class.
        """
        door_id = door_meant(self.door, now)
        current_map.check_annotation(self.key, self.value, now)
        if self.key == "name" and self.value:
            _check_unused(now, self.value, level_of(door_id, now), but=door_id)
        happened_ns = self._happened(now)
        kind = (
            current_map.class_meant(self.value, now)
            if self.key == CLASS and now.door_index.classes
            else DOOR
        )
        return [
            ev.DoorAnnotated(
                door_id=door_id, key=self.key, value=self.value, happened_ns=happened_ns
            ),
            *current_map.earlier_definition(kind, happened_ns, now),
        ]


@dataclass(frozen=True, slots=True)
class RequestDoor(DoorCommand):
    """Records that a state was requested."""

    state: DoorState | str

    def words(self) -> tuple[object, ...]:
        """Return the verb, and what it was given."""
        return ("request", self.door, self.state)

    def events(self, now: current_map.CurrentMap) -> list[ev.Event]:
        """Return the request."""
        door_id = door_meant(self.door, now)
        state = current_map.state_meant(self.state, current_map.class_of(door_id, now))
        return [ev.DoorRequested(door_id=door_id, state=state, happened_ns=self._happened(now))]


@dataclass(frozen=True, slots=True)
class PassDoor(DoorCommand):
    """A robot went through a door, or gave up waiting."""

    passed: bool
    waited_s: float

    def words(self) -> tuple[object, ...]:
        """Return the verb, and what it was given."""
        return ("passed", self.door, self.passed, self.waited_s)

    def events(self, now: current_map.CurrentMap) -> list[ev.Event]:
        """Return the passing."""
        return [
            ev.DoorPassed(
                door_id=door_meant(self.door, now),
                passed=self.passed,
                waited_s=self.waited_s,
                happened_ns=self._happened(now),
            )
        ]


@dataclass(frozen=True, slots=True)
class RetractEvents(WordedCommand):
    """Events are to be taken back."""

    first: int
    last: int

    def words(self) -> tuple[object, ...]:
        """Return the verb, and what it was given."""
        return ("retract", self.first, self.last)

    def events(self, now: current_map.CurrentMap) -> list[ev.Event]:
        """Return the retraction.

        Raises:
            CommandError: There is no such event, or nothing that can be taken back.
        """
        now.past.check_retraction(self.first, self.last)
        happened_ns = self._happened(now)
        return [ev.Retracted(first_event=self.first, last_event=self.last, happened_ns=happened_ns)]


@dataclass(frozen=True, slots=True)
class PinMoment(WordedCommand):
    """A moment gets a name."""

    name: str
    at_ns: int | None
    """The moment; None: now."""

    def words(self) -> tuple[object, ...]:
        """Return the verb, and the name."""
        return ("pin", self.name)

    def events(self, now: current_map.CurrentMap) -> list[ev.Event]:
        """Return the pin, with the state of its moment where another pin has it."""
        at_ns = now.now_ns() if self.at_ns is None else self.at_ns
        kept = kept_pin(now.reader, at_ns)
        if kept is None:
            return [ev.MomentPinned(at_ns=at_ns, name=self.name)]
        return [replace(kept, name=self.name, happened_ns=None)]


@dataclass(frozen=True, slots=True)
class StartPatrol(WordedCommand):
    """A round begins."""

    def words(self) -> tuple[object, ...]:
        """Return the verb."""
        return ("start_patrol",)

    def events(self, now: current_map.CurrentMap) -> list[ev.Event]:
        """Return its beginning; its number is one more than the last one's."""
        number = last_patrol(now.reader, ev.PatrolStarted) + 1
        return [ev.PatrolStarted(patrol=number, happened_ns=self._happened(now))]


@dataclass(frozen=True, slots=True)
class FinishPatrol(WordedCommand):
    """The round that began last is over."""

    def words(self) -> tuple[object, ...]:
        """Return the verb."""
        return ("finish_patrol",)

    def events(self, now: current_map.CurrentMap) -> list[ev.Event]:
        """Return its end.

        Raises:
            CommandError: No round is under way.
        """
        number = last_patrol(now.reader, ev.PatrolStarted)
        if number <= last_patrol(now.reader, ev.PatrolFinished):
            line = command_line("patrol", now.path, "start")
            raise CommandError(f"no patrol round is under way; to begin one: {line}")
        return [ev.PatrolFinished(patrol=number, happened_ns=self._happened(now))]


def door_meant(door: str | int, now: current_map.CurrentMap) -> DoorId:
    """Return the door that a command is about; does not check that a door of that id exists.

    Raises:
        UnknownDoorError: No door has that name, or more than one.
    """
    if not isinstance(door, str) and ev.is_whole_number(door):
        return DoorId(int(door))  # whether it is there, the validator says
    return now.resolve(door)


def level_of(door_id: DoorId, now: current_map.CurrentMap) -> int:
    """Return the level that a door is on; 0 for one that is not there."""
    known = now.state.door(door_id)
    return known.level if known else 0


def _check_unused(
    now: current_map.CurrentMap, name: str, level: int, *, but: DoorId | None = None
) -> None:
    """Check that the name is unused on this level.

    Raises:
        CommandError: Another door has it; then the name would mean neither.
    """
    for door in now.state.door_map().doors.values():
        if (door.name, door.level) == (name, level) and door.door_id != but:
            raise CommandError(
                f"door {door.door_id} of that level is called {name!r} already; "
                "choose another name."
            )


DIGITS = 6
"""A fit gives other last bits on another processor: the command is the same by micrometres."""


@dataclass(frozen=True, slots=True)
class RebaseMap(WordedCommand):
    """A level is to have a new map, and its doors their places in it."""

    floor: ev.FloorMap
    by: RigidTransform
    measured: Mapping[DoorId | str, MeasuredDoor]
    level: int | str | None

    def words(self) -> tuple[object, ...]:
        """Return the verb, and what it was given; of the map a digest of its cells."""
        floor = self.floor
        cells = (floor.cells.shape, hashlib.sha256(floor.cells.tobytes()).hexdigest())
        lies = (floor.resolution, floor.origin_x, floor.origin_y, floor.origin_theta)
        doors = sorted((str(door), tuple(at)) for door, at in self.measured.items())
        by = [round(number, DIGITS) for number in self.by.as_list()]
        return ("rebase", self.level or 0, lies, cells, by, doors)

    def events(self, now: current_map.CurrentMap) -> list[ev.Event]:
        """Return the map, and each door's new place.

        Raises:
            CommandError: As for `plan_rebase`.
            UnknownDoorError: A measured door is not known.
        """
        at_ns = happened_ns = self._happened(now)
        if at_ns is None and now.state.latest_happened_ns > now.now_ns():
            happened_ns = now.state.latest_happened_ns  # the clock went back: all comes before it
        level = now.level_meant(self.level)
        then = now.state if at_ns is None else replay(now.reader, Scope(at_ns=at_ns))
        measured = {now.resolve(door): at for door, at in self.measured.items()}
        event = _floor_event(then, level)
        there = None if event is None else _floor(now.reader, event)
        states = MapStates(then, now.state, there, now.path)
        plan = plan_rebase(states, self.floor, self.by, measured, level=level)
        return list(plan.events(happened_ns))


def _floor_event(state: DoorMapState, level: int) -> int | None:
    known = state.door_map().levels.get(level)
    return None if known is None else known.floor_map_event


def _floor(reader: LogReader, number: int) -> ev.FloorMap:
    """Return the floor plan that an event carries."""
    event = reader.event(number).event
    assert isinstance(event, ev.FloorMap)
    return event
