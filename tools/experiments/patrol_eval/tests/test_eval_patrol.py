"""`eval_patrol.py` in small: its building, its worlds, and that it learns as a log does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from steady_clock import SteadyClock

import semmap_log as sl
from patrol_eval.building import PatrolledBuilding, clinic
from patrol_eval.patrol_planners import Fixed, NearestFirst, TryEnded
from patrol_eval.patrol_report import interval, report
from patrol_eval.patrol_rounds import rounds_of, starts
from patrol_eval.patrol_scores import scored
from patrol_eval.patrol_world import WEEK_NS, PatrolWorld, RoundRules
from patrol_eval.short_tour import short_tour
from semmap_log.analysis.beliefs.door_beliefs import learn
from semmap_log.analysis.planning.patrol_round import PatrolTarget
from semmap_log.analysis.probabilities.belief_fold import BeliefProjection
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded

NAMES = ("L1_left_consult_rm_1_outer", "L1_left_consult_rm_1_inner", "L1_hr", "L1_wc_2")


def three_rooms() -> PatrolledBuilding:
    """Return a corridor of four doors, ten seconds apart; the first two lead into one room."""
    at_s = np.arange(1, 5) * 10.0
    rooms = (PatrolTarget("two", (0, 1)), PatrolTarget("hr", (2,)), PatrolTarget("wc", (3,)))
    ids = tuple(DoorId(number) for number in range(1, 5))
    return PatrolledBuilding(ids, NAMES, rooms, at_s, np.abs(at_s[:, None] - at_s), "UTC")


@pytest.mark.slow
def test_the_clinic_has_the_rooms_of_the_trial() -> None:
    """
    69 rooms at two halls, 53 of them with two doors; each can be come to.
    """
    building = clinic()

    assert len(building.rooms) == 69
    assert sum(len(room.doors) == 2 for room in building.rooms) == 53
    assert np.isfinite(building.leg_s).all()
    assert np.allclose(building.leg_s, building.leg_s.T)


def test_a_week_has_95_rounds() -> None:
    """
    75 of them on working days.
    """
    found = starts(0)

    assert (len(found), sum(is_workday for _, is_workday in found)) == (95, 75)
    assert all(0 <= start < WEEK_NS for start, _ in found)


def test_the_fixed_round_tries_the_other_door_at_its_end() -> None:
    """
    And only of rooms whose first was shut.
    """
    plan = Fixed(three_rooms(), [0, 1, 2]).start(0)
    tried = []
    while (door := plan.next_door()) is not None:
        tried.append(door)
        plan.tell(TryEnded(door, passed=door == 3, now_s=0.0))

    assert tried == [0, 2, 3, 1]


def test_the_nearest_first_visits_each_room_once() -> None:
    """
    The second door of a room only where the first was shut.
    """
    plan = NearestFirst(three_rooms()).start(0)
    tried = []
    while (door := plan.next_door()) is not None:
        tried.append(door)
        plan.tell(TryEnded(door, passed=door != 0, now_s=0.0))

    assert tried == [0, 1, 2, 3]


def test_the_same_seed_is_the_same_world() -> None:
    """
    And planners do not change it: what is met at a door follows from the time alone.
    """
    worlds = [PatrolWorld(three_rooms(), seed, weeks=1) for seed in (1, 1, 2)]
    at_ns = worlds[0].monday_ns + np.arange(0, WEEK_NS, WEEK_NS // 500)
    states = [[w.truths[0].state(int(at)) for at in at_ns] for w in worlds]

    assert states[0] == states[1]
    assert states[0] != states[2]


def test_scores_by_hand() -> None:
    """
    Visits, failed approaches, and the round's end for a reachable room that was not visited.
    """
    building, rules = three_rooms(), RoundRules(budget_s=600.0)
    world = PatrolWorld(building, 3, weeks=1)
    made = next(iter(rounds_of(world, NearestFirst(building), rules)))

    found = scored(world, made, rules, [True, False, True])

    visits = {one.door: one.at_s for one in made.tries if one.passed}
    two = min((visits[door] for door in (0, 1) if door in visits), default=600.0)
    assert found.failed == sum(not one.passed for one in made.tries)
    assert found.latency_s == pytest.approx(two + visits.get(3, 600.0))
    assert found.reachable == 2


def test_it_learns_what_a_log_of_the_same_events_teaches(tmp_path: Path) -> None:
    """
    The fold that is fed round by round, and the log that is read at the end: the same beliefs.
    """
    building = three_rooms()
    world = PatrolWorld(building, 4, weeks=1)
    fold = BeliefProjection("filter", building.tz)
    ids = np.array(building.door_ids, np.uint32)
    added = EventBatch.of(DoorAdded, happened_ns=world.monday_ns, door_id=ids)
    beliefs = fold.apply(fold.initial(), added)
    clock = SteadyClock(world.monday_ns)
    with sl.create(tmp_path / "log", tz=building.tz, clock=clock, durability="none") as log:
        log.append([DoorAdded(door_id=door) for door in building.door_ids])
        for made in rounds_of(world, NearestFirst(building), RoundRules()):
            beliefs = fold.apply(beliefs, EventBatch.from_events(made.events))
            clock.now_ns = made.start_ns + 3600 * 10**9
            log.append(made.events)
    read = learn(sl.read(tmp_path / "log"))

    at_ns = np.array([world.monday_ns + WEEK_NS + hour * 3600 * 10**9 for hour in range(24)])
    for door in building.door_ids:
        fed, told = (each.predict(door, at_ns) for each in (beliefs, read))
        np.testing.assert_allclose(fed.p_open, told.p_open, rtol=1e-6)
        np.testing.assert_array_equal(fed.is_known, told.is_known)


def test_a_short_tour_is_the_shortest_of_a_row() -> None:
    """
    From one end of a corridor to the other.
    """
    at_s = np.array([30.0, 10.0, 50.0, 20.0, 40.0])

    assert short_tour(at_s, np.abs(at_s[:, None] - at_s)) == [1, 3, 0, 4, 2]


def test_the_report_is_paired_by_seed() -> None:
    """
    Mean of the ratios, with Student's interval; points for shares.
    """
    names = ("failed", "failed_workdays", "reachable", "reached", "visited", "latency_s", "last_s",
             "driving_s", "rounds")  # fmt: skip

    def trial(seed: int, failed: float) -> dict:
        ones = dict.fromkeys(names, 10.0)
        return {"seed": seed, "planners": {"fixed": [ones | {"failed": 100.0}],
                                           "ours": [ones | {"failed": failed}]}}  # fmt: skip

    found = report([trial(0, 80.0), trial(1, 90.0)])

    failed = found["weeks"][0]["differences"]["ours against fixed"]["failed approaches"]
    assert failed["mean"] == pytest.approx(-15.0)
    assert failed["half_width"] == pytest.approx(12.71 * 5.0, rel=1e-3)
    assert np.isnan(interval([1.0])["half_width"])
