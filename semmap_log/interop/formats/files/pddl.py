"""Doors as a PDDL problem: objects, facts, and P(open) as the cost of passing; and its domain.

What planners take decides the form. Costs are whole numbers that actions add to `total-cost`
(`:action-costs`, PDDL 3.1): that is read by all that know costs, while Fast Downward and its kin
refuse real numbers and other fluents. A cost is -1000 ln P(open), so that the cheapest plan is the
way that is likeliest open from end to end. The text is ASCII. Names are as every PDDL parser takes
them: letters, digits, `-` and `_`, in small letters; the log's own names of doors are in comments,
as JSON strings, which no name can end. The domain is made to be read, and changed, by its user.
"""

from __future__ import annotations

import json
import math
import re
import unicodedata
from collections import Counter
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from semmap_log.analysis.rooms.room_graph import annotated_rooms
from semmap_log.core.model.doors import Door, DoorId, DoorMap, DoorState
from semmap_log.core.model.moments import format_utc
from semmap_log.core.texts import command_line
from semmap_log.errors import CommandError
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
    """The room where the robot is: name, or level/name; None: unknown."""
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
    names = annotated_rooms(door)
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
            about: Facts about the log, such as its building.
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


K = TypeVar("K", bound=Hashable)

MOST_LETTERS = 60

_KEYWORDS = """
    either object number domain problem define and or not forall exists when imply oneof unknown
    increase decrease assign scale-up scale-down minimize maximize total-cost total-time is-
    violated preference at over start end all always sometime within at-most-once sometime-after
    sometime-before always-within hold-during hold-after duration true false undefined total-
    order
"""
KEYWORDS = frozenset(_KEYWORDS.split())
"""Words of PDDL, and of its dialects, that some parser takes for more than a name."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What an object is called by people."""

    kind: str
    """`door`, `room`: begins the names that would begin with no letter."""
    text: str
    """Any text at all, or none."""
    mark: str
    """Distinguishes it from others of that name, such as `3`; letters, digits, `-` and `_`."""


def pddl_names(wanted: Mapping[K, Wanted], taken: Collection[str] = ()) -> dict[K, str]:
    """Return a name for each object, no two alike.

    Names that would be alike, or a word of PDDL, get a suffix of kind and mark: `hall-door-3`.

    Args:
        wanted: Object -> what it is called; their order decides where even that is not enough.
        taken: Other names that mean something, in small letters.
    """
    plain = {key: plain_name(each) for key, each in wanted.items()}
    bearers = Counter(plain.values())
    used = KEYWORDS | set(taken)
    names = {key: name for key, name in plain.items() if bearers[name] == 1 and name not in used}
    used |= set(plain.values())
    for key, each in wanted.items():
        if key not in names:
            names[key] = _free(f"{plain[key]}-{each.kind}-{each.mark}", used)
            used |= {names[key]}
    return {key: names[key] for key in wanted}


def plain_name(wanted: Wanted) -> str:
    """Return what a name is without what PDDL does not take: `Tür 1` is `tur-1`."""
    parts = unicodedata.normalize("NFKD", wanted.text)
    letters = "".join(letter for letter in parts if not unicodedata.combining(letter)).lower()
    name = re.sub(r"[^a-z0-9_-]+", "-", letters).strip("-_")[:MOST_LETTERS].strip("-_")
    if not name:
        return f"{wanted.kind}-{wanted.mark}"
    return name if name[0].isalpha() else f"{wanted.kind}-{name}"


def _free(name: str, used: Collection[str]) -> str:
    """Return the name, with a number appended if it is in use."""
    number, free = 1, name
    while free in used:
        number += 1
        free = f"{name}-{number}"
    return free


DOMAIN = "semmap-doors"

WORDS = frozenset(
    "door room robot-at door-between open closed other-state checked pass-cost pass "
    f"wait-and-pass try-and-pass check {DOMAIN} doors".split()
)
"""What means something in the domain: no object is called so."""

_HEAD = f"""\
; A robot, rooms, and the doors between them: the domain of the problems that
; `semmap-log export LOG problem.pddl` writes. Change it as you like.
(define (domain {DOMAIN})
  (:requirements :strips :typing{{costs}})
  (:types door room)
  (:predicates
    (robot-at ?r - room)
    (door-between ?d - door ?a ?b - room) ; both ways round
    (open ?d - door)                      ; its last known state; one of these three
    (closed ?d - door)
    (other-state ?d - door)               ; UNKNOWN, MOVING or OFFLINE
    (checked ?d - door))                  ; somebody was there and looked
"""

_FUNCTIONS = """\
  (:functions
    (total-cost) - number
    (pass-cost ?d - door) - number) ; -1000 ln P(open)
"""

_GO = """
  (:action {name} ; {why}
    :parameters (?d - door ?from ?to - room)
    :precondition (and (robot-at ?from) (door-between ?d ?from ?to) ({state} ?d))
    :effect (and (not (robot-at ?from)) (robot-at ?to) (checked ?d){then}
                 (increase (total-cost) (pass-cost ?d))))
"""

_CHECK = """
  (:action check ; look at it from either side
    :parameters (?d - door ?here ?there - room)
    :precondition (and (robot-at ?here) (door-between ?d ?here ?there))
    :effect (and (checked ?d) (increase (total-cost) 1)))
)
"""

_COST = re.compile(r"\n? *\(increase \(total-cost\) (?:\([^()]*\)|\d+)\)")


def dump_domain(*, with_costs: bool = True) -> str:
    """Return the domain's text.

    Args:
        with_costs: False: for planners that know STRIPS and types alone.
    """
    ways = (
        ("pass", "open", "as far as known it is open", ""),
        ("wait-and-pass", "closed", "somebody has to open it", " (not (closed ?d)) (open ?d)"),
        ("try-and-pass", "other-state", "it may be either",
         " (not (other-state ?d)) (open ?d)"),
    )  # fmt: skip
    actions = "".join(
        _GO.format(name=name, state=state, why=why, then=then) for name, state, why, then in ways
    )
    if with_costs:
        return f"{_HEAD.format(costs=' :action-costs')}{_FUNCTIONS}{actions}{_CHECK}"
    return _COST.sub("", f"{_HEAD.format(costs='')}{actions}{_CHECK}")
