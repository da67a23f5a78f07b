"""Doors as a PDDL problem: whatever they are called, each planner reads it, and reads the same."""

from __future__ import annotations

import math
import re
from types import MappingProxyType
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from semmap_log.core.model.doors import NAN, Door, DoorId, DoorMap, DoorState, Level
from semmap_log.errors import CommandError
from semmap_log.interop.formats.files.pddl import (
    KEYWORDS,
    WORDS,
    Likely,
    NamedRoom,
    PddlProblem,
    Wanted,
    Wishes,
    dump_domain,
    pass_cost,
    pddl_names,
    rooms_between,
)
from tests.pddl import expression_of

A_NAME = re.compile(r"[a-z][a-z0-9_-]*")


def door(number: int, name: str = "", rooms: str = "", **more: Any) -> Door:
    said = {"name": name, "rooms": rooms}
    annotations = MappingProxyType({key: text for key, text in said.items() if text})
    values = {"level": 0, "state": DoorState.OPEN, **more}
    return Door(DoorId(number), x=NAN, y=NAN, theta=NAN, width=NAN, prob_open=NAN,
                prob_closed=NAN, annotations=annotations, **values)  # fmt: skip


def doors(*all_of_them: Door, levels: dict[int, Level] | None = None) -> DoorMap:
    return DoorMap({each.door_id: each for each in all_of_them}, levels or {})


def dumped(door_map: DoorMap, p_open: float = 0.5, **wishes: Any) -> str:
    likely = {door_id: Likely(p_open, is_known=True) for door_id in door_map.doors}
    return PddlProblem.of(door_map).dump(likely, {}, Wishes(**wishes))


def section(text: str, name: str) -> list[Any]:
    """Return what a problem's section holds."""
    return next(part[1:] for part in expression_of(text) if part[0] == name)


FRONT = door(1, "Front door", "lobby, CoE lab")
SIDE = door(2, "side", "lobby,CoE lab", state=DoorState.CLOSED)
STORE = door(3, "store", state=DoorState.MOVING)


def test_doors_are_objects_with_their_state_their_rooms_and_what_they_cost() -> None:
    """Both ways round: PDDL knows no other symmetry. MOVING is neither open nor closed."""
    text = dumped(doors(FRONT, SIDE, STORE), start="lobby", goal="CoE lab")

    assert ["front-door", "-", "door", "side", "-", "door", "store", "-", "door",
            "coe-lab", "-", "room", "lobby", "-", "room"] == section(text, ":objects")  # fmt: skip
    facts = section(text, ":init")
    assert [["open", "front-door"], ["closed", "side"], ["other-state", "store"]] == [
        fact for fact in facts if fact[0] in {"open", "closed", "other-state"}
    ]
    assert 4 == sum(fact[0] == "door-between" for fact in facts)
    assert ["door-between", "front-door", "coe-lab", "lobby"] in facts
    assert ["=", ["pass-cost", "side"], "693"] in facts
    assert ["robot-at", "lobby"] in facts
    assert [["robot-at", "coe-lab"]] == section(text, ":goal")
    assert ["minimize", ["total-cost"]] == section(text, ":metric")


def test_the_cheapest_way_is_the_one_that_is_likeliest_open() -> None:
    """Costs are -1000 ln P: whole, at least 1, and what is nearly never open has an end, too."""
    ways = [(0.9, 0.8, 0.7), (0.6,), (0.5, 0.99)]

    by_cost = sorted(ways, key=lambda way: sum(map(pass_cost, way)))

    assert by_cost == sorted(ways, key=math.prod, reverse=True)
    assert (1, 105, 6908, 6908) == tuple(map(pass_cost, (1.0, 0.9, 0.001, 0.0)))


def test_without_costs_nothing_of_them_is_left() -> None:
    """For planners that know STRIPS and types alone: neither in the problem nor in the domain."""
    problem = dumped(doors(FRONT), with_costs=False)

    assert "cost" in dumped(doors(FRONT))
    assert "cost" not in problem
    assert "cost" not in dump_domain(with_costs=False).replace("-1000", "")
    kinds = [part[0] for part in expression_of(dump_domain(with_costs=False))[2:]]
    assert [":requirements", ":types", ":predicates", *[":action"] * 4] == kinds


@pytest.mark.parametrize("with_costs", [True, False])
def test_the_domain_declares_all_that_it_and_a_problem_use(with_costs: bool) -> None:
    """And each action costs something, where anything does."""
    domain = expression_of(dump_domain(with_costs=with_costs))
    by_kind = {part[0]: part[1:] for part in domain[1:]}
    declared = {each[0] for each in by_kind[":predicates"]}
    actions = [part for part in domain if part[0] == ":action"]
    facts = section(dumped(doors(FRONT, SIDE, STORE), start="lobby", goal="store"), ":init")

    used = {fact[0] for fact in facts if fact[0] != "="}
    for action in actions:
        effects = action[action.index(":effect") + 1][1:]
        used |= {(e[1] if e[0] == "not" else e)[0] for e in effects if e[0] != "increase"}
        assert with_costs is any(effect[0] == "increase" for effect in effects)

    assert used == declared
    assert declared | {action[1] for action in actions} <= WORDS


@pytest.mark.parametrize(
    ("rooms", "expected"),
    [
        ("lobby,lab", ("lobby", "lab")),
        (" lobby , CoE lab ", ("lobby", "CoE lab")),
        ("", None),
        ("lobby", None),
        ("lobby,", None),
        ("a,b,c", None),
        ("hall,hall", None),
    ],
)
def test_two_rooms_with_a_comma_between_are_joined(
    rooms: str, expected: tuple[str, str] | None
) -> None:
    """Anything else joins none, and no way leads through."""
    found = rooms_between(door(1, rooms=rooms, level=2))

    assert expected == (None if found is None else tuple(room.name for room in found))
    assert found is None or {2} == {room.level for room in found}


def test_rooms_of_the_same_name_on_two_levels_are_two() -> None:
    """Else a way would lead through the ceiling; which is meant has to be said."""
    levels = {n: Level(n, f"L{n}", 0.0) for n in (1, 2)}
    door_map = doors(door(1, "a", "hall,lab", level=1), door(2, "b", "hall,bath", level=2),
                     levels=levels)  # fmt: skip

    names = PddlProblem.of(door_map).room_names

    assert {"hall-room-1", "hall-room-2"} == {names[NamedRoom(level, "hall")] for level in (1, 2)}
    assert ["robot-at", "hall-room-2"] in section(dumped(door_map, start="L2/hall"), ":init")
    with pytest.raises(CommandError, match="hall-room-1, hall-room-2"):
        dumped(door_map, start="hall")


@pytest.mark.parametrize(
    ("goal", "expected"),
    [
        ("side", ["checked", "side"]),
        ("id:3", ["checked", "store"]),
        ("3", ["checked", "store"]),
        ("Front door", ["checked", "front-door"]),
        ("front-door", ["checked", "front-door"]),
        ("lobby", ["robot-at", "lobby"]),
        ("( and(checked side)\n (robot-at lobby))", ["and", ["checked", "side"],
                                                     ["robot-at", "lobby"]]),
    ],
)  # fmt: skip
def test_a_goal_is_a_room_a_door_or_a_condition(goal: str, expected: list[Any]) -> None:
    """As people call them, or as the file does."""
    assert [expected] == section(dumped(doors(FRONT, SIDE, STORE), goal=goal), ":goal")


@pytest.mark.parametrize(
    "goal",
    ["cellar", "", "(checked side", "(checked side))", "(a) (b)", "(a) ; no", '(a "b")', "(a) b"],
)
def test_a_goal_that_is_none_is_refused(goal: str) -> None:
    """With what would be one; nothing is left open that the file would close elsewhere."""
    with pytest.raises(CommandError, match=r"goal .*expected"):
        dumped(doors(FRONT, SIDE), goal=goal)


def test_a_start_that_is_no_room_is_refused() -> None:
    """With those that are, or how to make some."""
    with pytest.raises(CommandError, match=r"expected a room; the rooms are coe-lab, lobby\."):
        dumped(doors(FRONT), start="cellar")
    with pytest.raises(CommandError, match="annotate LOG DOOR rooms"):
        dumped(doors(STORE), start="cellar")


def test_what_is_not_said_stays_open_and_says_so() -> None:
    """No goal is one that every state fulfils, as planners take it."""
    text = dumped(doors(FRONT))

    assert [["and"]] == section(text, ":goal")
    assert "; no goal was given" in text
    assert "; no start was given" in text
    assert "robot-at" not in {fact[0] for fact in section(text, ":init")}


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("Tür 1", "tur-1"),
        ("main_door", "main_door"),
        ("101", "door-101"),
        ("门", "door-7"),
        ("", "door-7"),
        ("a\n(define) ; b", "a-define-b"),
        ("-x_", "x"),
        ("not", "not-door-7"),
        ("unknown", "unknown-door-7"),
        ("Open", "open-door-7"),
        ("x" * 500, "x" * 60),
    ],
)
def test_names_are_made_safe(text: str, name: str) -> None:
    """Small letters, digits, - and _, a letter first, and no word that means something."""
    assert name == pddl_names({1: Wanted("door", text, "7")}, WORDS)[1]


def test_names_that_would_be_alike_are_told_apart() -> None:
    """PDDL knows no capitals. A name that has all to itself keeps it."""
    texts = ["Hall", "hall", "hall-door-1", "lab"]
    wanted = {n: Wanted("door", text, str(n)) for n, text in enumerate(texts)}

    assert ["hall-door-0", "hall-door-1-2", "hall-door-1", "lab"] == list(
        pddl_names(wanted).values()
    )


hostile = st.text(max_size=12) | st.sampled_from(
    [
        "a",
        "A",
        "ä",
        ")",
        "\n(open x)",
        "; x",
        "define",
        "room",
        "\x7f",
        "\u2028",
        "door-1",
        '"',
        "\\",
    ]
)
hostile_doors = st.lists(
    st.tuples(hostile, hostile, hostile, st.sampled_from(DoorState), st.integers(0, 2)), max_size=5
)


@given(hostile_doors, hostile)
@example([("a", "a", "b", DoorState.OPEN, 0), ("a-door-1", "x", "y", DoorState.OPEN, 0)], "x")
def test_no_name_breaks_a_file(drawn: list[Any], building: str) -> None:
    """Objects are as many as there are doors and rooms, all told apart; nothing else is said."""
    door_map = doors(
        *(
            door(n, name, f"{a},{b}", state=state, level=level)
            for n, (name, a, b, state, level) in enumerate(drawn)
        )
    )
    problem = PddlProblem.of(door_map)
    likely = {door_id: Likely(0.5, is_known=True) for door_id in door_map.doors}

    text = problem.dump(likely, {"building": building})

    assert text.isascii()
    objects = section(text, ":objects")
    names = objects[::3]
    assert {"door", "room"} >= set(objects[2::3])
    assert len(drawn) + len(problem.room_names) == len(names) == len(set(names))
    assert all(A_NAME.fullmatch(name) for name in names)
    assert not set(names) & (KEYWORDS | WORDS)
    joined = sum(rooms_between(each) is not None for each in door_map.doors.values())
    assert 1 + 2 * len(drawn) + 2 * joined == len(section(text, ":init"))
    assert text == problem.dump(likely, {"building": building})
