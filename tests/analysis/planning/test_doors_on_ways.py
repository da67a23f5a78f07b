"""The doors that a trip can lead through."""

from __future__ import annotations

from itertools import pairwise, permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.analysis.planning.door_trip import doors_between
from semmap_log.analysis.rooms import OUTSIDE, Doorway, Lift, Room, RoomGraph
from semmap_log.core.model.doors import DoorId


def graph_of(*pairs: tuple[int, int], lifts: tuple[Lift, ...] = ()) -> RoomGraph:
    """Return rooms joined by doors 1, 2, … in that order."""
    doorways = {
        DoorId(number): Doorway(DoorId(number), 1, left, right)
        for number, (left, right) in enumerate(pairs, start=1)
    }
    rooms = {room for pair in pairs for room in pair if room != OUTSIDE}
    return RoomGraph({room: Room(room, 1, None, 9.0, 0.0, 0.0) for room in rooms}, doorways, lifts)


def test_not_by_the_outside() -> None:
    """Unless the trip begins there."""
    graph = graph_of((1, OUTSIDE), (OUTSIDE, 2), (1, 2))

    assert doors_between(graph, 1, 2) == [3]
    assert doors_between(graph, OUTSIDE, 2) == [1, 2, 3]


def test_by_a_lift() -> None:
    """Its own doors are not on the list: it opens them."""
    lift = Lift("lift", (DoorId(2), DoorId(3)))
    graph = graph_of((1, 2), (2, 5), (3, 6), (3, 4), lifts=(lift,))

    assert doors_between(graph, 1, 4) == [1, 4]


@given(st.lists(st.tuples(st.integers(1, 6), st.integers(1, 6)), max_size=12))
def test_against_all_ways(pairs: list[tuple[int, int]]) -> None:
    """Each way that comes to no room twice, by trying all of them."""
    joins = [(one, other) for one, other in pairs if one != other]
    graph = graph_of(*joins)

    expected = set()
    for size in range(5):
        for between in permutations(range(2, 6), size):
            way = [1, *between, 6]
            steps = [{a, b} for a, b in pairwise(way)]
            if all(step in [set(pair) for pair in joins] for step in steps):
                expected |= {n for n, pair in enumerate(joins, start=1) if set(pair) in steps}

    assert doors_between(graph, 1, 6) == sorted(expected)


@pytest.mark.parametrize("loop", [(1, 1)])
def test_a_loop_is_on_no_way(loop: tuple[int, int]) -> None:
    """Its room has another, open end."""
    assert doors_between(graph_of(loop, (1, 2)), 1, 2) == [2]
