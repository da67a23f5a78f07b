"""Doors as facts."""

from __future__ import annotations

import math
from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from semmap_log.domain.doors import Door, DoorId, DoorMap, DoorState
from semmap_log.oprs.expressions import Symbol, write
from semmap_log.oprs.facts import all_facts, changed_facts

DOOR = Door(DoorId(3), 0, 1.0, 1.0, 0.0, 1.0, DoorState.OPEN, 0.75, math.nan)


def _map(*doors: Door) -> DoorMap:
    return DoorMap({door.door_id: door for door in doors}, {})


def _lines(facts: list[object]) -> list[str]:
    return [write(fact) for fact in facts]  # type: ignore[arg-type]


def test_all_facts() -> None:
    """
    State and P(open) of each door, ids ascending; what was removed too, for who may remember it.
    """
    other = replace(DOOR, door_id=DoorId(1), state=DoorState.MOVING, prob_open=math.nan)

    facts = all_facts(_map(DOOR, other), removed=[DoorId(2)])

    assert [
        "(DOOR_STATE DOOR_1 MOVING)", "(DOOR_PROBABILITY DOOR_1 NIL)",
        "(DOOR_STATE DOOR_2 REMOVED)", "(DOOR_PROBABILITY DOOR_2 NIL)",
        "(DOOR_STATE DOOR_3 OPEN)", "(DOOR_PROBABILITY DOOR_3 0.75)",
    ] == _lines(facts)  # fmt: skip


def test_what_changed_and_nothing_else() -> None:
    """
    One field, the other, both, a door that comes or goes; a door that was moved is no news.
    """
    closed = replace(DOOR, state=DoorState.CLOSED)
    unlikely = replace(DOOR, prob_open=0.1)

    assert ["(DOOR_STATE DOOR_3 CLOSED)"] == _lines(changed_facts(_map(DOOR), _map(closed)))
    assert ["(DOOR_PROBABILITY DOOR_3 0.1)"] == _lines(changed_facts(_map(DOOR), _map(unlikely)))
    assert [] == changed_facts(_map(DOOR), _map(replace(DOOR, x=5.0, last_event=7)))
    unknown = replace(DOOR, prob_open=math.nan)
    assert [] == changed_facts(_map(unknown), _map(replace(unknown, prob_open=float("nan"))))
    assert ["(DOOR_PROBABILITY DOOR_3 NIL)"] == _lines(changed_facts(_map(DOOR), _map(unknown)))
    gone = ["(DOOR_STATE DOOR_3 REMOVED)", "(DOOR_PROBABILITY DOOR_3 NIL)"]
    assert gone == _lines(changed_facts(_map(DOOR), _map()))
    assert all_facts(_map(DOOR)) == changed_facts(_map(), _map(DOOR))


DOORS = st.builds(
    lambda number, state, p_open: replace(
        DOOR, door_id=DoorId(number), state=state, prob_open=p_open
    ),
    st.integers(1, 4),
    st.sampled_from(DoorState),
    st.floats(0, 1) | st.just(math.nan),
)
MAPS = st.lists(DOORS, max_size=4).map(lambda doors: _map(*doors))


@given(st.lists(MAPS, min_size=1, max_size=6))
def test_changes_add_up(maps: list[DoorMap]) -> None:
    """
    A kernel that was told of all changes knows what one knows that was told all at the end.
    """
    knows: dict[tuple[Symbol, object], object] = {}
    for before, after in zip([_map(), *maps], maps, strict=False):
        knows |= {
            (fact.name, fact.terms[0]): fact.terms[1] for fact in changed_facts(before, after)
        }

    ever = [door_id for each in maps for door_id in each.doors]
    at_the_end = all_facts(maps[-1], removed=ever)
    assert {(fact.name, fact.terms[0]): fact.terms[1] for fact in at_the_end} == knows
