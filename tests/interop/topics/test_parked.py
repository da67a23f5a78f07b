"""A robot that parks before a door: what comes into the log of it, and what is believed then."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs import probabilities
from semmap_log.analysis.scans.visit import PlacedScan
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, RobotPose
from semmap_log.interop.importing.bag_importing import PlacesOverTime
from semmap_log.interop.topics.lasers.door_places import DoorsNow
from semmap_log.interop.topics.lasers.lasers import RobotScan
from semmap_log.interop.topics.lasers.scan_keeper import DoorsOverTime, LaserSightings, VisitCommit
from semmap_log.interop.topics.topic_reader import Known
from tests.analysis.scans.scenes import DOOR, LINE
from tests.analysis.scans.test_stands import OPEN, standing

MINUTE = 60 * 10**9
X, Y, THETA, WIDTH = LINE
ADDED = DoorAdded(door_id=DOOR, x=X, y=Y, theta=THETA, width=WIDTH, happened_ns=1)


def _placed(scans: list[PlacedScan]) -> list[RobotScan]:
    return [
        RobotScan(scan, RobotPose(level=0, x=0.0, y=0.0, theta=0.0, happened_ns=scan.stamp_ns),
                  "/scan")
        for scan in scans
    ]  # fmt: skip


def _told(doors: DoorsOverTime, scans: list[PlacedScan]) -> list[VisitCommit]:
    sightings = LaserSightings(doors, robot="tug1")
    return [*sightings.take(_placed(scans)), *sightings.close()]


def _recorded(
    sightings: LaserSightings, known: Known, scans: list[PlacedScan]
) -> list[VisitCommit]:
    """What is told as a recorder goes on, which heeds what it writes."""
    told = []
    for scan in _placed(scans):
        for commit in sightings.take([scan]):
            told.append(commit)
            for event in commit.events:
                known.apply(event)
    return told


def _seen(state: DoorState, minute: float) -> DoorObserved:
    at_ns = 1000 * 10**9 + round(minute * MINUTE)
    return DoorObserved(door_id=DOOR, state=state, happened_ns=at_ns)


def test_visits_that_say_the_same_again_are_counted_and_not_told() -> None:
    known = Known()
    known.apply(ADDED)
    sightings = LaserSightings(DoorsNow(known), robot="tug1")

    told = _recorded(sightings, known, standing(5))

    assert [DoorState.CLOSED] == [commit.visit.state for commit in told]
    assert sightings.tally.again > 5
    assert any(f"again from the same stand: {sightings.tally.again} visits" in line
               for line in sightings.tally.summary())  # fmt: skip
    assert 1 == sightings.tally.visits.total()


def test_what_somebody_else_said_meanwhile_is_gainsaid_at_once() -> None:
    """The map says OPEN: the robot sees that it is not."""
    known = Known()
    known.apply(ADDED)
    sightings, scans = LaserSightings(DoorsNow(known), robot="tug1"), standing(8)
    assert 1 == len(_recorded(sightings, known, scans[:120]))

    known.apply(_seen(DoorState.OPEN, 4))
    told = _recorded(sightings, known, scans[120:])

    assert [DoorState.CLOSED] == [commit.visit.state for commit in told]


def test_what_another_robot_of_the_bag_said_meanwhile_is_gainsaid_at_once(tmp_path: Path) -> None:
    log = sl.create(tmp_path / "office", tz="UTC")
    log.append([ADDED])
    other = [replace(scan, robot="two") for scan in standing(0.4, OPEN, from_min=3)]
    scans = sorted([*standing(8), *other], key=lambda scan: scan.stamp_ns)

    told = [(c.visit.robot, c.visit.state.name) for c in _told(PlacesOverTime(log), scans)]

    log.close()
    assert ("", "CLOSED") == told[0] == told[-1]
    assert 2 == told.count(("", "CLOSED"))
    assert ("two", "OPEN") in told


@pytest.mark.parametrize("where", ["in the log", "in the bag"])
def test_what_a_log_or_a_bag_says_meanwhile_is_gainsaid_once(where: str, tmp_path: Path) -> None:
    """By the visit that follows; then it is told as it was."""
    with sl.create(tmp_path / "office", tz="UTC") as log:
        log.append([ADDED])
        said = [_seen(DoorState.OPEN, 4)]
        if where == "in the log":
            log.append(said)
        doors = PlacesOverTime(log, [] if where == "in the log" else said)

        assert doors.state(DOOR, said[0].happened_ns or 0, 2000 * 10**9) is None
        assert doors.state(DOOR, 1000 * 10**9, 2000 * 10**9) is DoorState.OPEN
        assert doors.state(DoorId(99), 1000 * 10**9, 2000 * 10**9) is None
        told = _told(doors, standing(8))

    assert [0, 4] == [(c.visit.last_ns - 1000 * 10**9) // MINUTE for c in told]


def test_who_parks_grows_no_surer_and_sees_the_door_change(tmp_path: Path) -> None:
    """An hour and a half before a shut door: belief is never surer than after the first visit."""
    with sl.create(tmp_path / "office", tz="UTC") as log:
        log.append([ADDED])
        scans = [*standing(90), *standing(10, OPEN, from_min=90)]
        for commit in _told(PlacesOverTime(log), scans):
            log.append(commit.events, note=commit.note, sync=False)

        def p_open(minute: float) -> float:
            at = 1000 * 10**9 + round(minute * MINUTE)
            return probabilities(log, at=at, estimator="filter")[0].p_open

        first = p_open(1)
        assert first < 0.02
        assert all(p_open(minute) >= first for minute in range(5, 91, 5))
        assert p_open(92) > 0.5
