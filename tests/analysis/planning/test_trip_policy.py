"""At a shut door: wait, ask, or go round, by what takes least on average."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from semmap_log.analysis.planning.round_task import (
    GOAL,
    NOTHING,
    START,
    AtShutDoor,
    TripDoor,
    TripPolicy,
    TripTask,
    given_up,
    opened,
)
from semmap_log.errors import PlanError

NEAR, FAR = 0, 1


def two_ways(near: TripDoor, far: TripDoor) -> TripTask:
    """Return a room with two doors to the goal's: the near one is 10 s away, the far one 60 s."""
    walk = np.full((6, 6), math.inf)
    ways = {
        (START, 2): 10.0, (START, 4): 60.0, (2, 4): 55.0,
        (GOAL, 3): 10.0, (GOAL, 5): 60.0, (3, 5): 55.0,
    }  # fmt: skip
    for (one, other), seconds in ways.items():
        walk[one, other] = walk[other, one] = seconds
    return TripTask(walk, np.array([2.0, 2.0]), (near, far))


def test_the_expected_time_by_hand() -> None:
    """The near door is open with .5, else the far one, surely open, is 55 s away."""
    policy = TripPolicy(two_ways(TripDoor(0.5, 1e9), TripDoor(1.0, 1e9)))

    # 10 + .5 (2 + 10) + .5 (55 + 2 + 60)
    assert policy.expected_s == pytest.approx(10 + 0.5 * 12 + 0.5 * 117)
    assert policy.when_shut(2, NOTHING).best is AtShutDoor.ROUND


@pytest.mark.parametrize(("wait_s", "best"), [(30.0, AtShutDoor.WAIT), (200.0, AtShutDoor.ROUND)])
def test_waits_where_that_takes_less(wait_s: float, best: AtShutDoor) -> None:
    """Round takes 117 s from the near door; to wait takes the wait and 12 s."""
    policy = TripPolicy(two_ways(TripDoor(0.5, wait_s), TripDoor(1.0, 1e9)))

    choice = policy.when_shut(2, NOTHING)

    assert choice.best is best
    assert choice.round_s == pytest.approx(117.0)
    assert choice.wait_s == pytest.approx(wait_s + 12.0)


def test_asks_where_the_door_answers() -> None:
    """.8 of the time it opens within 8 s; else 30 s are lost, and it goes round."""
    near = TripDoor(0.0, math.inf, p_answers=0.8)
    policy = TripPolicy(two_ways(near, TripDoor(1.0, 1e9)))

    choice = policy.when_shut(2, NOTHING)

    assert choice.best is AtShutDoor.ASK
    assert choice.ask_s == pytest.approx(0.8 * (8 + 12) + 0.2 * (30 + 117))


def test_a_door_that_is_hardly_ever_open_is_not_tried_first() -> None:
    """Nor where the detour by it is dear; the far one is surely open."""
    policy = TripPolicy(two_ways(TripDoor(0.01, 1e9), TripDoor(1.0, 1e9)))

    # by the near one: 10 + .01 * 12 + .99 * 117 = 125.95; by the far one 60 + 2 + 60
    assert policy.next_place(START, NOTHING) == (4, pytest.approx(122.0))


def test_it_comes_back_when_both_are_shut() -> None:
    """What was found shut is not tried again: then it waits where it stands."""
    task = two_ways(TripDoor(0.5, 300.0), TripDoor(0.5, 100.0))
    policy = TripPolicy(task)

    found = given_up(NOTHING, NEAR)

    assert policy.next_place(2, found)[0] == 4
    assert policy.when_shut(4, found).best is AtShutDoor.WAIT
    assert math.isinf(policy.when_shut(4, found).round_s)


def test_a_way_back_through_a_door_that_was_open() -> None:
    """A room with two doors on the way: the second is shut, and it leaves by the first."""
    walk = np.full((8, 8), math.inf)
    ways = {
        (START, 2): 1.0, (3, 4): 5.0, (5, GOAL): 1.0,  # by the room: doors 0 and 1
        (START, 6): 50.0, (2, 6): 50.0, (7, GOAL): 50.0,  # round it: door 2
    }  # fmt: skip
    for (one, other), seconds in ways.items():
        walk[one, other] = walk[other, one] = seconds
    doors = (TripDoor(1.0, 1e9), TripDoor(0.5, 1e9), TripDoor(1.0, 1e9))
    policy = TripPolicy(TripTask(walk, np.ones(3), doors))

    found = given_up(opened(NOTHING, 0), 1)

    # back through door 0: 5 + 1, on to door 2: 50 + 1 + 50
    assert policy.to_goal_s(4, found) == pytest.approx(107.0)
    # 1 + 1 + 5, then .5 (1 + 1) or .5 of that
    assert policy.expected_s == pytest.approx(7 + 0.5 * 2 + 0.5 * 107)


def test_no_way_that_anybody_knows_of() -> None:
    """One door, shut, whose wait nobody knows: the expected time is none."""
    walk = np.full((4, 4), math.inf)
    walk[START, 2] = walk[2, START] = walk[3, GOAL] = walk[GOAL, 3] = 5.0
    policy = TripPolicy(TripTask(walk, np.ones(1), (TripDoor(0.5, math.inf),)))

    assert math.isinf(policy.expected_s)
    assert policy.when_shut(2, NOTHING).best is AtShutDoor.GIVE_UP


def test_rooms_that_no_door_joins_are_refused() -> None:
    """Whatever doors are open."""
    with pytest.raises(PlanError, match="no way leads"):
        TripPolicy(TripTask(np.full((2, 2), math.inf), np.zeros(0), ()))


def test_what_is_no_trip_is_refused() -> None:
    """Too many doors, shapes that do not fit, a P beyond 1."""
    task = two_ways(TripDoor(0.5, 1.0), TripDoor(0.5, 1.0))

    with pytest.raises(PlanError, match="at most 8 doors"):
        TripPolicy(TripTask(np.zeros((20, 20)), np.zeros(9), (TripDoor(0.5, 1.0),) * 9))
    with pytest.raises(PlanError, match="expected times of shape"):
        replace(task, cross_s=np.zeros(3))
    with pytest.raises(PlanError, match="expected P of"):
        TripDoor(1.5, 1.0)


@pytest.mark.parametrize("seed", range(5))
def test_the_expected_time_is_that_of_trips_that_follow_it(seed: int) -> None:
    """Doors drawn at random: within three standard errors."""
    random = np.random.default_rng(seed)
    near, far = (TripDoor(*random.uniform((0.1, 20), (0.9, 300))) for _ in range(2))
    policy = TripPolicy(two_ways(near, far))

    times = np.array([_driven(policy, (near, far), random) for _ in range(2000)])

    error = times.std() / math.sqrt(len(times))
    assert abs(times.mean() - policy.expected_s) <= 3 * error + 1e-9


def _driven(policy: TripPolicy, doors: tuple[TripDoor, ...], random: np.random.Generator) -> float:
    is_open = [random.random() < door.p_open for door in doors]
    place, found, now_s = START, NOTHING, 0.0
    while (target := policy.next_place(place, found)[0]) != GOAL:
        now_s += policy.walk_s(place, target, found)
        door = TripTask.door_at(target)
        if not is_open[door]:
            if policy.when_shut(target, found).best is AtShutDoor.ROUND:
                place, found = target, given_up(found, door)
                continue
            now_s += doors[door].wait_s
        place, found, now_s = TripTask.other_side(target), opened(found, door), now_s + 2.0
    return now_s + policy.walk_s(place, GOAL, found)
