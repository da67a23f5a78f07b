"""Trips through a log's doors: the expected time, and what to do at one that is shut."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.analysis.planning.door_chances import beliefs_at, wait_s
from semmap_log.analysis.planning.door_trip import door_trip
from semmap_log.analysis.planning.round_task import AtShutDoor
from semmap_log.core.model.events import DoorAdded
from semmap_log.core.model.moments import HOUR_NS
from semmap_log.errors import PlanError
from semmap_log.interop.formats.json.trip_json import trip_to_json
from semmap_log.views.rebase_table import trip_table
from tests.analysis.planning.ward import DOOR_Y, HALL, PLAN, STORE, ward
from tests.analysis.rooms.buildings import drawn
from tests.conftest import SteadyClock

NOON = "2026-03-20T12:10"
IN_THE_WARD = "2,4,1"
IN_THE_STORE = "5.5,4,1"
IN_THE_LAB = "8.5,4,1"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    return ward(tmp_path_factory.mktemp("ward") / "log")


def test_through_open_doors_it_takes_as_long_as_the_walk(log: sl.DoorLog) -> None:
    """A little longer on average; by the lab's only door, and by one of the ward's two."""
    trip = door_trip(log, IN_THE_WARD, IN_THE_LAB, depart=NOON)

    assert trip.stops[-1].door.name == "lab"
    assert {"front", "side"} & {stop.door.name for stop in trip.stops}
    assert trip.walk_s == pytest.approx(12, abs=6)
    assert trip.walk_s < trip.expected_s < 10 * 3600
    assert [door.name for door in trip.others] in (["side"], ["front"])


def test_a_door_that_never_opens(log: sl.DoorLog) -> None:
    """There is no other way into the store: it waits, for long."""
    trip = door_trip(log, HALL, IN_THE_STORE, depart=NOON)

    (stop,) = trip.stops
    assert stop.p_open < 0.2
    assert stop.if_shut.best is AtShutDoor.WAIT
    assert math.isinf(stop.if_shut.round_s)
    assert stop.wait_s is not None
    assert stop.wait_s > 3600
    assert trip.expected_s > 3600


def test_in_one_room_no_door_counts(log: sl.DoorLog) -> None:
    """It walks."""
    trip = door_trip(log, "1,1,1", "9,1,1", depart=NOON)

    assert trip.stops == ()
    assert trip.expected_s == pytest.approx(8 / 0.7, abs=1)


def test_where_it_asks(log: sl.DoorLog) -> None:
    """The store's door never opened for who asked; whether the front's would nobody knows: said."""
    store = door_trip(log, HALL, IN_THE_STORE, depart=NOON, asks=True).stops[0]
    front = door_trip(log, HALL, IN_THE_WARD, depart=NOON, asks=True)

    assert store.p_answers is not None
    assert store.p_answers < 0.3
    assert any("never asked for" in note for note in front.notes)


def test_doors_without_evidence(log: sl.DoorLog) -> None:
    """UNKNOWN: nobody knows how long to wait, so there is no expected time, and JSON has null."""
    trip = door_trip(log, HALL, IN_THE_STORE, depart="2026-03-02T06:00")

    assert math.isinf(trip.expected_s)
    assert any("UNKNOWN" in note for note in trip.notes)
    assert any("no expected time" in note for note in trip.notes)
    assert trip_to_json(trip)["expected_s"] is None


def test_to_a_door_means_before_it(log: sl.DoorLog) -> None:
    """From the hall no door is on the way, from the store its own."""
    from_hall = door_trip(log, HALL, "3", depart=NOON)
    from_store = door_trip(log, IN_THE_STORE, "3", depart=NOON)

    assert from_hall.stops == from_store.stops == ()
    assert from_hall.goal.y < DOOR_Y < from_store.goal.y


def test_where_nothing_is_known_of_any_door_what_stands_in_is_said(log: sl.DoorLog) -> None:
    """Not "as the others do on average": there are none."""
    trip = door_trip(log, HALL, IN_THE_STORE, depart="2026-03-02T06:00")

    assert any("P counts as 0.5, since" in n for n in trip.notes)
    lines = [str(line) for line in trip_table(trip).renderables]  # type: ignore[attr-defined]
    assert "doors on the ways: store" in lines


def test_without_a_floor_plan_it_says_that_it_goes_straight(log: sl.DoorLog) -> None:
    """As `patrol-plan` does; doors cannot count there. With no map at all it is refused."""
    trip = door_trip(log, "0,0,2", "7,0,2", depart=NOON)

    assert trip.expected_s == pytest.approx(10)
    assert trip.notes == (
        "level L2 has no floor plan: distances are straight lines; doors do not count",
    )
    with pytest.raises(PlanError, match="neither a floor plan nor a door"):
        door_trip(log, "0,0", "7,0", depart="2026-03-01T06:00")


def test_patience_is_told(log: sl.DoorLog) -> None:
    """What a wait takes longer does not count, so the expected time is not that of all trips."""
    trip = door_trip(log, HALL, IN_THE_STORE, depart=NOON, patience_s=60.0)

    assert trip.expected_s < 3600
    assert any("waits count up to 60 s" in note for note in trip.notes)
    for none in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(PlanError, match="patience: expected"):
            door_trip(log, HALL, IN_THE_STORE, depart=NOON, patience_s=none)


@pytest.mark.parametrize(
    ("start", "goal", "said"),
    [
        (HALL, "0,0,2", "no way leads"),
        ("3.75,4,1", HALL, "wall"),
        (HALL, "-400,1,1", "outside of the floor plan"),
        (HALL, "room:9", "expected a name, or a number"),
    ],
)
def test_what_is_no_trip_is_refused(log: sl.DoorLog, start: str, goal: str, said: str) -> None:
    """Rooms that nothing joins, walls, places off the map, rooms that there are not."""
    with pytest.raises(PlanError, match=said):
        door_trip(log, start, goal, depart=NOON)


def test_the_best_way_after_the_log_s_end(log: sl.DoorLog) -> None:
    """Days ahead `schedule` is asked, which knows of no waits."""
    trip = door_trip(log, HALL, IN_THE_STORE, depart="2026-04-20T12:10")

    assert trip.estimator == "schedule"
    assert math.isinf(trip.expected_s)


def test_the_wait_at_a_shut_door_is_that_of_what_is_known_at_the_departure(
    tmp_path: Path,
) -> None:
    """Doors that report themselves are known until the log ends; P lies on a grid of 5 min."""
    clock = SteadyClock(0)
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.append([drawn(PLAN, level=1, cell_m=0.1, scale=5)])
        log.append([DoorAdded(door_id=STORE, level=1, x=5.0, y=DOOR_Y, theta=0.0, width=1.0)])
        for hour in range(1, 400):
            clock.now_ns = hour * HOUR_NS
            log.update_door(STORE, state="open" if hour % 2 else "closed")

    query, _ = beliefs_at(log, None, estimator=None, tz=None, progress=None)
    (stop,) = door_trip(log, HALL, IN_THE_STORE).stops
    arrives = stop.arrives_ns
    perhaps, surely = (wait_s(query, STORE, arrives, is_shut=shut) for shut in (False, True))

    assert stop.p_open > 0.99
    assert surely == stop.wait_s
    assert perhaps == pytest.approx((1 - stop.p_open) * surely, rel=0.5)
    assert 600 < surely < 4 * 3600
