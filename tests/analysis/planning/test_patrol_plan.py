"""Patrols of a log: what comes first, what is left out, and what is said of it."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.analysis.planning.door_chances import SkipRule
from semmap_log.analysis.planning.patrol_plan import (
    PatrolOptions,
    PatrolPlan,
    WaysBetween,
    patrol_ways,
)
from semmap_log.analysis.planning.round_planner import patrol_plan
from semmap_log.analysis.rooms import Place, room_plan
from semmap_log.core.model.moments import SECOND_NS
from semmap_log.errors import PlanError, UnknownDoorError
from tests.analysis.planning.ward import FRONT, HALL, SIDE, ward

MORNING = "2026-03-20T10:00"
"""A Friday."""


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    return ward(tmp_path_factory.mktemp("ward") / "log")


def doors_of(plan: PatrolPlan) -> list[str | None]:
    return [stop.door.name for stop in plan.stops]


def left_out_of(plan: PatrolPlan) -> dict[str, str]:
    return {each.name: each.reason for each in plan.left_out}


def test_open_rooms_in_order_and_the_store_left_out(log: sl.DoorLog) -> None:
    """From the middle of the hall: the lab and the room of two doors; the store is shut."""
    plan = patrol_plan(log, start_at=HALL, start=MORNING, rooms=["lab", "store", "2"])

    assert set(doors_of(plan)) == {"lab", "front"}
    assert [stop.is_known for stop in plan.stops] == [True, True]
    assert all(stop.p_passes > 0.8 for stop in plan.stops)
    assert left_out_of(plan) == {"store": "shut"}
    assert "shut at" in plan.left_out[0].said
    times_ns = [stop.arrives_ns for stop in plan.stops]
    assert times_ns == sorted(times_ns)


def test_the_other_door_of_a_room_is_named(log: sl.DoorLog) -> None:
    """To be tried where the first is shut; in an odd hour the front is likelier."""
    plan = patrol_plan(log, start_at=HALL, start=MORNING)

    two = next(stop for stop in plan.stops if len(stop.target.doors) == 2)
    assert {two.door.name, *(door.name for door in two.others)} == {"front", "side"}


def test_what_seems_shut_is_looked_at_again_after_a_day(log: sl.DoorLog) -> None:
    """On Monday the last look at the store is two days old: it is a stop again, and why is said."""
    plan = patrol_plan(log, start_at=HALL, start="2026-03-25T10:00", estimator="filter")

    assert "store" in doors_of(plan)
    why = next(stop.why for stop in plan.stops if stop.door.name == "store")
    assert "looked at again" in why


def test_nothing_is_left_out_if_told_so(log: sl.DoorLog) -> None:
    """Skipping can be turned off."""
    plan = patrol_plan(log, start_at=HALL, start=MORNING, options=PatrolOptions(skip=SkipRule(0.0)))

    assert "store" in doors_of(plan)


def test_only_what_was_known_at_the_start_counts(log: sl.DoorLog) -> None:
    """On the first morning nobody has looked at any door: all are UNKNOWN, and that is said."""
    plan = patrol_plan(log, start_at=HALL, start="2026-03-02T06:00")

    assert [stop.is_known for stop in plan.stops] == [False] * 3
    assert {stop.p_passes for stop in plan.stops} == {0.5}
    assert {stop.wait_s for stop in plan.stops} == {None}
    assert any("nothing is known of any door" in note for note in plan.notes)


def test_p_is_that_at_the_time_of_arrival(log: sl.DoorLog) -> None:
    """A round that starts before eight comes to the front when it is open: P is higher than now."""
    late = PatrolOptions(enter_s=3000.0)
    plan = patrol_plan(log, start_at=HALL, start="2026-03-20T07:10", options=late)

    p = {stop.door.name: stop.p_passes for stop in plan.stops}
    first = patrol_plan(log, start_at=HALL, start="2026-03-20T07:10", rooms=["2"])
    assert plan.stops[0].door.name == "lab"
    assert p["front"] > first.stops[0].p_passes + 0.2


def test_the_robot_starts_where_the_log_saw_it_last(log: sl.DoorLog) -> None:
    """Where no place is named; in a log without poses at the first stop, which is said."""
    plan = patrol_plan(log, start=MORNING)

    assert plan.start == Place(1, 5.0, 1.0)
    assert plan.stops[0].arrives_ns > plan.start_ns


def test_without_a_pose_it_starts_at_its_first_stop(log: sl.DoorLog) -> None:
    """Before the first pose there is none."""
    plan = patrol_plan(log, start="2026-03-02T12:00", doors=["lab", "front"])

    assert plan.start is None
    assert plan.stops[0].arrives_ns == plan.start_ns
    assert any("begins at its first stop" in note for note in plan.notes)


def test_the_budget_cuts_off(log: sl.DoorLog) -> None:
    """What is reached later is named."""
    plan = patrol_plan(log, start_at=HALL, start=MORNING, options=PatrolOptions(budget_s=20.0))

    assert len(plan.stops) == 1
    assert "budget" in left_out_of(plan).values()


def test_where_the_robot_asks_p_is_that_of_passing(log: sl.DoorLog) -> None:
    """The store's never opened for who asked; of the front nobody knows whether it would."""
    asks = PatrolOptions(asks=True, skip=SkipRule(0.0))
    plan = patrol_plan(log, start_at=HALL, start="2026-03-20T12:00", options=asks)

    stops = {stop.door.name: stop for stop in plan.stops}
    assert stops["lab"].p_passes > 0.8
    assert stops["store"].p_passes < 0.2
    front = stops.get("front") or stops["side"]
    assert front.high == 1.0


def test_a_level_without_a_plan_in_straight_lines(log: sl.DoorLog) -> None:
    """Said; and of the cellar's door nobody knows anything."""
    plan = patrol_plan(log, start_at="0,0,2", start=MORNING, doors=["attic", "cellar"])

    assert doors_of(plan) == ["attic", "cellar"]
    assert (plan.stops[0].arrives_ns - plan.start_ns) / 1e9 == pytest.approx(3.5 / 0.7, abs=0.1)
    assert [stop.is_known for stop in plan.stops] == [True, False]
    assert any("no floor plan" in note for note in plan.notes)
    assert any("UNKNOWN" in note for note in plan.notes)


def test_doors_without_a_place_or_a_way_are_left_out(log: sl.DoorLog) -> None:
    """Named, with why; the rest is planned."""
    plan = patrol_plan(log, start_at=HALL, start=MORNING, doors=["loose", "attic", "lab"])

    assert doors_of(plan) == ["lab"]
    assert left_out_of(plan) == {"loose": "no place", "attic": "no way"}


@pytest.mark.parametrize(
    ("asked", "error", "said"),
    [
        ({"start_at": "3.75,4.0"}, PlanError, "wall"),
        ({"start_at": "500,1,1"}, PlanError, "outside of the floor plan"),
        ({"start_at": "5,1"}, PlanError, "X,Y,LEVEL"),
        ({"start_at": "5,1,9"}, PlanError, "no level '9'"),
        ({"start_at": "nowhere"}, PlanError, "expected X,Y"),
        ({"start_at": "loose"}, PlanError, "no place in the map"),
        ({"rooms": ["99"]}, PlanError, "semmap-log rooms"),
        ({"doors": ["gate"]}, UnknownDoorError, "gate"),
        ({"doors": ["loose"]}, PlanError, "nothing can be visited"),
        ({"options": PatrolOptions(budget_s=0.0)}, PlanError, "budget: expected"),
        ({"options": PatrolOptions(speed_m_s=0.0)}, PlanError, "speed: expected"),
        ({"options": PatrolOptions(wait_s=-1.0)}, PlanError, "wait: expected"),
    ],
)
def test_what_cannot_be_planned_is_refused(
    log: sl.DoorLog, asked: dict, error: type[Exception], said: str
) -> None:
    """With what was expected."""
    if asked.get("start_at") == "3.75,4.0":
        asked = {"start_at": "3.75,4.0,1"}
    with pytest.raises(error, match=said):
        patrol_plan(log, start=MORNING, **asked)


def test_a_log_without_doors(tmp_path: Path) -> None:
    """There is nothing to visit."""
    sl.create(tmp_path / "empty", tz="UTC").close()

    with pytest.raises(PlanError, match="no door is in the map"):
        patrol_plan(sl.read(tmp_path / "empty"))


def test_ways_from_stop_to_stop_are_those_of_the_times(log: sl.DoorLog) -> None:
    """From the middle of the hall and on; as long as the arrivals say, and not through walls."""
    plan = patrol_plan(log, start_at=HALL, start=MORNING, rooms=["lab", "2"])
    ways = WaysBetween(room_plan(log, at=MORNING), speed_m_s=plan.options.speed_m_s)

    found = patrol_ways(plan, ways)

    assert [way[0] for way in found] == [plan.start, plan.stops[0].place]
    assert [way[-1] for way in found] == [stop.place for stop in plan.stops]
    first_s = (plan.stops[0].arrives_ns - plan.start_ns) / SECOND_NS
    assert length_m(found[0]) / plan.options.speed_m_s == pytest.approx(first_s, abs=0.5)
    assert len(found[0]) > 2


def test_ways_lead_through_doors_that_are_likely_shut_only_if_they_must(log: sl.DoorLog) -> None:
    """Into the ward: by the front where the side is avoided, by either where both are."""
    ways = WaysBetween(room_plan(log, at=MORNING))
    hall, ward_ = Place(1, 3.0, 1.0), Place(1, 3.0, 4.0)

    by_side, by_front = ways.way(hall, ward_), ways.way(hall, ward_, [SIDE])

    assert length_m(by_side) < length_m(by_front)
    assert ways.way(hall, ward_, [SIDE, FRONT]) == by_side
    assert ways.way(Place(2, 0.0, 0.0), Place(2, 9.0, 0.0)) == [
        Place(2, 0.0, 0.0), Place(2, 9.0, 0.0)
    ]  # fmt: skip


def length_m(way: list[Place]) -> float:
    return sum(math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairwise(way))
