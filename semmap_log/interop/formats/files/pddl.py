"""Doors as a PDDL problem: objects, facts, and P(open) as what it costs to pass.

What planners take decides the form. Costs are whole numbers that actions add to `total-cost`
(`:action-costs`, PDDL 3.1): that is read by all that know costs, while Fast Downward and its kin
refuse real numbers and other fluents. A cost is -1000 ln P(open), so that the cheapest plan is the
way that is likeliest open from end to end. The text is ASCII; what a log calls a door is told in
comments, as JSON strings, which no name can end.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from semmap_log.analysis.rooms.room_names import rooms_told
from semmap_log.core.model.doors import Door, DoorId, DoorMap, DoorState
from semmap_log.core.model.moments import format_utc
from semmap_log.core.texts import command_line
from semmap_log.errors import CommandError
from semmap_log.interop.formats.files.pddl_domain import DOMAIN, WORDS
from semmap_log.interop.formats.files.pddl_names import Wanted, pddl_names
from semmap_log.interop.formats.parsing.problems import shown

LEAST_P = 0.001
"""A door that is less likely open costs no more: costs are whole numbers."""

_FACTS = {DoorState.OPEN: "open", DoorState.CLOSED: "closed"}


_EXPORT = command_line("export", "LOG", "problem.pddl")
_ANNOTATE = command_line("annotate", "LOG", "DOOR", "rooms", "lobby,corridor")


@dataclass(frozen=True, slots=True, order=True)
class NamedRoom:
    """A room of a level; the same name on another level is another room."""

    level: int
    name: str


@dataclass(frozen=True, slots=True)
class Likely:
    """How likely a door is open."""

    p_open: float
    is_known: bool
    """False: too little was seen of it for that to mean much."""


@dataclass(frozen=True, slots=True)
class Wishes:
    """What the problem is to say besides the doors."""

    start: str | None = None
    """The room where the robot is: name, or level/name; None: not said."""
    goal: str | None = None
    """A room to be in, a door to be checked, or a condition in PDDL; None: left to the user."""
    with_costs: bool = True
    """False: for planners that know STRIPS and types alone."""


def pass_cost(p_open: float) -> int:
    """Return what it costs to pass a door: 1000 times -ln P(open), a whole number, at least 1."""
    return max(1, round(-1000 * math.log(max(p_open, LEAST_P))))


def rooms_between(door: Door) -> tuple[NamedRoom, NamedRoom] | None:
    """Return the two rooms that a door joins by its annotation `rooms`: `lobby,corridor`.

    None: it has none, or it does not name two.
    """
    names = rooms_told(door)
    if names is None or not all(names):
        return None
    return NamedRoom(door.level, names[0]), NamedRoom(door.level, names[1])


@dataclass(frozen=True, slots=True)
class PddlProblem:
    """The objects of a problem and what they are called in it."""

    door_map: DoorMap
    door_names: Mapping[DoorId, str]
    room_names: Mapping[NamedRoom, str]

    @classmethod
    def of(cls, door_map: DoorMap) -> PddlProblem:
        """Name the doors of a map, and the rooms that they join."""
        doors = sorted(door_map.doors.values(), key=lambda door: door.door_id)
        rooms = sorted({room for door in doors for room in rooms_between(door) or ()})
        wanted: dict[DoorId | NamedRoom, Wanted] = {
            room: Wanted("room", room.name, str(room.level)) for room in rooms
        }
        wanted |= {
            door.door_id: Wanted("door", door.name or "", str(door.door_id)) for door in doors
        }
        names = pddl_names(wanted, WORDS)
        return cls(
            door_map,
            {door.door_id: names[door.door_id] for door in doors},
            {room: names[room] for room in rooms},
        )

    def dump(
        self, likely: Mapping[DoorId, Likely], about: Mapping[str, str], wishes: Wishes = Wishes()
    ) -> str:
        """Return the text.

        Args:
            likely: Of each door.
            about: What is said of the log, such as its building.
            wishes: Start and goal.

        Raises:
            CommandError: There is no such room or door, or the goal is no PDDL.
        """
        goal = "(and)" if wishes.goal is None else self._goal(wishes.goal)
        doors = [self.door_map[door_id] for door_id in self.door_names]
        lines = [
            *self._head(about),
            "(define (problem doors)",
            f"  (:domain {DOMAIN})",
            *self._objects(doors),
            "  (:init",
            *(["    (= (total-cost) 0)"] if wishes.with_costs else []),
            *self._start(wishes.start),
            *(
                line
                for door in doors
                for line in self._facts(door, likely[door.door_id], with_costs=wishes.with_costs)
            ),
            "  )",
            *(["  ; no goal was given: write yours"] if wishes.goal is None else []),
            f"  (:goal {goal})",
            *(["  (:metric minimize (total-cost))"] if wishes.with_costs else []),
            ")",
        ]
        return "\n".join(lines) + "\n"

    def _head(self, about: Mapping[str, str]) -> list[str]:
        said = {**about, "moment": format_utc(self.door_map.moment_ns)}
        return [
            f"; The doors of a log, as `{_EXPORT}` writes them.",
            *(f"; {key}: {_quoted(text)}" for key, text in said.items() if text),
            f"; event: {self.door_map.event}",
        ]

    def _objects(self, doors: Sequence[Door]) -> list[str]:
        """Return what is declared; a kind of which there is nothing is left out."""
        said = ["  (:objects"]
        for door in doors:
            level = self.door_map.level_name(door.level)
            called = f"; door {door.door_id}, level {_quoted(level)}"
            name = f", {_quoted(door.name)}" if door.name else ""
            said.append(f"    {self.door_names[door.door_id]} - door {called}{name}")
        for room, name in self.room_names.items():
            level = self.door_map.level_name(room.level)
            said.append(f"    {name} - room ; level {_quoted(level)}, {_quoted(room.name)}")
        return [*said, "  )"]

    def _start(self, start: str | None) -> list[str]:
        if start is None:
            return ["    ; no start was given: (robot-at ROOM)"] if self.room_names else []
        return [f"    (robot-at {self._room(start)})"]

    def _facts(self, door: Door, likely: Likely, *, with_costs: bool) -> list[str]:
        name = self.door_names[door.door_id]
        said = [f"    ({_FACTS.get(door.state, 'other-state')} {name})"]
        if rooms := rooms_between(door):
            a, b = (self.room_names[room] for room in rooms)
            said.append(f"    (door-between {name} {a} {b}) (door-between {name} {b} {a})")
        if with_costs:
            known = "" if likely.is_known else ", by too little"
            comment = f"; P(open) {likely.p_open:.4f}{known}"
            said.append(f"    (= (pass-cost {name}) {pass_cost(likely.p_open)}) {comment}")
        return said

    def _goal(self, goal: str) -> str:
        """Return a goal in PDDL: as it was given, or what the name of a room or a door means."""
        text = goal.strip()
        if text.startswith("("):
            return _expression(text)
        if rooms := self._rooms_called(text):
            return f"(robot-at {self._only(text, rooms)})"
        doors = [
            name
            for door_id, name in self.door_names.items()
            if text in {name, *_called(self.door_map[door_id], self.door_map)}
        ]
        if not doors:
            raise CommandError(
                f"goal {shown(goal)}: expected a room, a door, or a condition such as "
                f"(checked {next(iter(self.door_names.values()), 'front')})"
                f"{self._rooms_that_are()}"
            )
        return f"(checked {_one_of(text, doors)})"

    def _room(self, text: str) -> str:
        rooms = self._rooms_called(text)
        if not rooms:
            raise CommandError(f"start {shown(text)}: expected a room{self._rooms_that_are()}")
        return self._only(text, rooms)

    def _rooms_called(self, text: str) -> list[NamedRoom]:
        named = {
            room: {room.name, f"{self.door_map.level_name(room.level)}/{room.name}", name}
            for room, name in self.room_names.items()
        }
        return [room for room, names in named.items() if text in names]

    def _only(self, text: str, rooms: Sequence[NamedRoom]) -> str:
        return _one_of(text, [self.room_names[room] for room in rooms])

    def _rooms_that_are(self) -> str:
        if not self.room_names:
            return f"; no door joins rooms yet: {_ANNOTATE}"
        return f"; the rooms are {_listed(self.room_names.values())}."


def _called(door: Door, door_map: DoorMap) -> set[str]:
    """Return what a goal may call a door, as commands do."""
    ids = {str(door.door_id), f"id:{door.door_id}"}
    if door.name is None:
        return ids
    return {door.name, f"{door_map.level_name(door.level)}/{door.name}", *ids}


def _one_of(text: str, names: Sequence[str]) -> str:
    if len(names) > 1:
        raise CommandError(f"{shown(text)} may be any of {_listed(names)}; say which.")
    return names[0]


def _listed(names: Iterable[str], most: int = 10) -> str:
    said = list(names)
    return ", ".join([*said[:most], *(["…"] if len(said) > most else [])])


_TOKENS = re.compile(r"\s*(?:(?P<paren>[()])|(?P<word>[A-Za-z0-9_?=<>.+*/-]+))")


def _expression(text: str) -> str:
    """Return one expression in PDDL, on one line.

    Raises:
        CommandError: It is none, or more than one.
    """
    depth, at, said = 0, 0, list[str]()
    while at < len(text):
        found = _TOKENS.match(text, at)
        if found is None or (said and not depth):
            break
        depth += {"(": 1, ")": -1}.get(found["paren"], 0)
        said.append(found["paren"] or found["word"])
        at = found.end()
    if at < len(text) or depth:
        raise CommandError(
            f"goal {shown(text)}: expected one condition in PDDL, with a ) for each (, "
            f"got {shown(text[at:]) if at < len(text) else 'its end'} too early."
        )
    return re.sub(r"(?<=\() | (?=\))", "", " ".join(said))


def _quoted(text: str) -> str:
    r"""Return a text as a JSON string of ASCII alone: a line end in it is `\n`."""
    return json.dumps(text).replace("\x7f", "\\u007f")
