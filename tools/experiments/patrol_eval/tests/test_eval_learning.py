"""`eval_patrol.py --learning` in small: where a robot goes that only looks, and its score."""

from __future__ import annotations

import numpy as np
import pytest

from patrol_eval.learning import CONTINUING, TRUE, forecasts, learning_report
from patrol_eval.looking_rounds import Planned, Tour, by_age, looked, looks
from patrol_eval.patrol_rounds import starts
from patrol_eval.patrol_world import PatrolWorld
from patrol_eval.tests.test_eval_patrol import three_rooms
from semmap_log.analysis.probabilities.belief_fold import BeliefProjection, Beliefs
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorAdded
from semmap_log.core.model.moments import HOUR_NS


def world() -> PatrolWorld:
    """Return four doors along a corridor, ten seconds apart, for two weeks."""
    return PatrolWorld(three_rooms(), 5, weeks=2)


def knowing(now: PatrolWorld, seen: list[tuple[int, float, DoorState]]) -> Beliefs:
    """Return what looks at doors teach, hours after the world's Monday."""
    fold = BeliefProjection("filter", now.building.tz)
    ids = np.array(now.building.door_ids, np.uint32)
    added = EventBatch.of(DoorAdded, happened_ns=now.monday_ns, door_id=ids)
    beliefs = fold.apply(fold.initial(), added)
    for door, hour, state in seen:
        at_ns = now.monday_ns + round(hour * HOUR_NS)
        told = now.look(door, at_ns)
        beliefs = fold.apply(beliefs, EventBatch.from_events([type(told)(
            happened_ns=at_ns, door_id=told.door_id, state=state,
            accuracy_open=told.accuracy_open, accuracy_closed=told.accuracy_closed,
        )]))  # fmt: skip
    return beliefs


def test_a_tour_goes_on_where_it_stopped() -> None:
    """
    Or begins anew; each door once.
    """
    nothing = knowing(world(), [])

    goes_on = Tour([2, 0, 3, 1], stays=True).doors(nothing, 0, 0)
    anew = Tour([2, 0, 3, 1], stays=False).doors(nothing, 0, None)

    assert goes_on == [3, 1, 2, 0]
    assert anew == [2, 0, 3, 1]


def test_a_round_looks_until_its_time_is_over() -> None:
    """
    From home to the first door 10 s, 10 s more to each; what it sees is how the doors are.
    """
    now = world()
    start_ns = now.monday_ns + 9 * HOUR_NS

    seen = looks(now, [0, 1, 2, 3], None, start_ns, 30.0)
    further = looks(now, [3, 0], 2, start_ns, 30.0)

    assert [each.door_id for each in seen] == [1, 2, 3]
    assert [(each.happened_ns - start_ns) / 1e9 for each in seen] == [10.0, 20.0, 30.0]
    assert all(each.state is now.truths[door].state(each.happened_ns)
               for door, each in enumerate(seen))  # fmt: skip
    assert [each.door_id for each in further] == [4]


def test_a_tour_goes_on_over_a_leg_that_is_longer_than_a_round() -> None:
    """
    From the last door back to the first it is 30 s; rounds are over after 25 s.
    """
    now = world()

    beliefs = looked(now, Tour([0, 1, 2, 3], stays=True), budget_s=25.0, weeks=1)

    last_ns = [beliefs.evidence.counts(door, now.end_ns).last_seen_ns
               for door in now.building.door_ids]  # fmt: skip
    assert min(at or 0 for at in last_ns) > now.monday_ns + 6 * 24 * HOUR_NS


def test_the_plan_goes_to_likely_doors_or_to_those_unseen_for_long() -> None:
    """
    Off from between: the one just seen open at one end, those seen before, shut, at the other.
    """
    now = world()
    shut = [(door, hour / 2, DoorState.CLOSED) for hour in range(16) for door in (0, 1, 2)]
    beliefs = knowing(now, [*shut, *((3, 4 + hour / 4, DoorState.OPEN) for hour in range(20))])
    start_ns = now.monday_ns + 9 * HOUR_NS

    likely, unseen = (
        list(Planned(now.building, 3600.0, by_age=age).doors(beliefs, start_ns, 1))
        for age in (False, True)
    )

    assert likely.index(3) < likely.index(0)
    assert unseen.index(0) < unseen.index(3)


def test_the_weight_of_age() -> None:
    """
    1 for a door that nobody ever saw, and for the one that was not seen for longest.
    """
    assert by_age(np.array([50.0, 100.0, np.inf]))[:, 0].tolist() == [0.5, 1.0, 1.0]
    assert by_age(np.array([np.inf]))[:, 0].tolist() == [1.0]


def test_who_begins_at_home_does_not_see_the_far_end() -> None:
    """
    Rounds of 25 s reach two of four doors; whoever goes on sees all.
    """
    now = world()

    for stays, expected in ((True, 4), (False, 2)):
        beliefs = looked(now, Tour([0, 1, 2, 3], stays=stays), budget_s=25.0, weeks=1)
        seen = [beliefs.evidence.counts(door, now.end_ns).last_seen_ns
                for door in now.building.door_ids]  # fmt: skip
        assert sum(at is not None for at in seen) == expected
    assert len(starts(0)) == 95


def test_a_door_that_nobody_saw_is_forecast_as_the_others() -> None:
    """
    On average; and as .5 where nothing is known.
    """
    now = world()
    times_ns = now.monday_ns + np.array([30, 40]) * HOUR_NS
    looks_at = [(door, hour / 2, DoorState.OPEN) for hour in range(40) for door in (0, 1, 2)]

    found = forecasts(knowing(now, looks_at), now.building, times_ns, int(times_ns[0]))
    nothing = forecasts(knowing(now, []), now.building, times_ns, int(times_ns[0]))

    np.testing.assert_allclose(found[3], found[:3].mean(axis=0))
    assert (nothing == 0.5).all()


def test_the_report_is_against_the_tour_that_goes_on() -> None:
    """
    Percent of its score, and of what it has above the true schedule's.
    """
    trials = [{"seed": seed, "brier": {TRUE: 0.09, CONTINUING: 0.1, "ours": 0.102}}
              for seed in (1, 2)]  # fmt: skip

    found = learning_report(trials)["differences"]["ours"]

    assert found["brier, %"]["mean"] == pytest.approx(2.0)
    assert found["excess over the true schedule, %"]["mean"] == pytest.approx(20.0)


def test_what_was_seen_late_is_learnt_at_the_end() -> None:
    """
    Who learns after each 40 of 95 rounds has learnt all of them in the end.
    """
    now = world()
    each, seldom = (
        looked(now, Tour([0, 1, 2, 3], stays=True, learn_every=every), budget_s=25.0, weeks=1)
        for every in (1, 40)
    )

    for door in now.building.door_ids:
        last_ns, at_last_ns = (
            beliefs.evidence.counts(door, now.end_ns).last_seen_ns for beliefs in (each, seldom)
        )
        assert last_ns == at_last_ns
