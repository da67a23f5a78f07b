"""What a long recording leaves out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'semmap-log[viewer]'")

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorObserved,
    DoorUpdated,
    Retracted,
    RobotPose,
)
from semmap_log.views.rerun import scene
from semmap_log.views.rerun.recording import save_rrd
from semmap_log.views.rerun.scene import LeftOut, drawn_poses
from tests.conftest import SteadyClock
from tests.views.rerun.some_logs import SECOND, START, Drawn

pytestmark = pytest.mark.viewer

DOOR = DoorId(1)


@pytest.fixture(autouse=True)
def every_log_is_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scene, "FULL_UP_TO", 0)


def told(tmp_path: Path, sightings: list[tuple[int, DoorState]], back: int | None = None) -> Drawn:
    """Record sightings at these seconds, in this order; `back` is taken back."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START + 1000 * SECOND)) as log:
        log.append([DoorAdded(door_id=DOOR, happened_ns=START)])
        for second, state in sightings:
            at_ns = START + second * SECOND
            log.append([DoorObserved(door_id=DOOR, state=state, happened_ns=at_ns)])
        if back is not None:
            log.append([Retracted(first_event=back, last_event=back)])
    save_rrd(sl.read(tmp_path / "log"), tmp_path / "x.rrd")
    return Drawn(tmp_path / "x.rrd")


def lines(drawn: Drawn) -> list[int]:
    rows = drawn.rows("/events/door_observed", "TextLog:text", "event")
    return [number for number, _ in rows]


def test_repeats_have_no_line(tmp_path: Path) -> None:
    """A sighting of what is known already is left out; the changes stay."""
    opened, closed = DoorState.OPEN, DoorState.CLOSED

    drawn = told(tmp_path, [(1, opened), (2, opened), (3, closed), (4, closed), (5, opened)])

    assert [1, 3, 5] == lines(drawn)


def test_of_repeats_only_sightings_are_left_out(tmp_path: Path) -> None:
    """What somebody said about a door stays, though it changes nothing."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([DoorAdded(door_id=DOOR, state=DoorState.OPEN)])
        log.append([DoorObserved(door_id=DOOR, state=DoorState.OPEN)])
        log.append([DoorUpdated(door_id=DOOR, changed=Changed.STATE, state=DoorState.OPEN)])

    save_rrd(sl.read(tmp_path / "log"), tmp_path / "x.rrd")

    drawn = Drawn(tmp_path / "x.rrd")
    assert [] == lines(drawn)
    assert 1 == len(drawn.rows("/events/door_updated", "TextLog:text"))


def test_around_late_and_undone_sightings_every_line_stays(tmp_path: Path) -> None:
    """The second OPEN is a change after the late CLOSED."""
    opened, closed = DoorState.OPEN, DoorState.CLOSED

    drawn = told(
        tmp_path,
        [(1, opened), (9, opened), (5, closed), (10, opened), (11, closed), (12, opened)],
        back=5,
    )

    assert [1, 2, 3, 5, 6] == lines(drawn)


def test_the_summary_says_how_much_was_left_out(tmp_path: Path) -> None:
    """A robot that stands still is drawn once in half a minute."""
    clock = SteadyClock(START)
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.append([DoorAdded(door_id=DOOR, state=DoorState.OPEN)])
        for second in range(2, 62, 2):
            clock.now_ns = START + second * SECOND
            log.append([DoorObserved(door_id=DOOR, state=DoorState.OPEN)])
            log.append([RobotPose(x=1.0, y=1.0, theta=0.0)])

    summary = save_rrd(sl.read(tmp_path / "log"), tmp_path / "x.rrd")

    assert LeftOut(repeats=30, poses=27) == summary.left_out
    said = "without 30 lines of sightings that repeat a state and 27 poses close to others"
    assert said == str(summary.left_out)
    assert "" == str(LeftOut())


def test_a_slow_robot_is_not_lost() -> None:
    """Steps of 1 cm: each fifth pose is drawn, as are those of a robot that turns."""
    n = 101
    still, level = np.zeros(n), np.zeros(n, np.uint16)
    times = np.zeros(n, np.int64)

    creeping = drawn_poses(np.arange(n) * 0.01 + 1e-6, still, still, level, times)
    turning = drawn_poses(still, still, np.arange(n) * np.radians(1.0) + 1e-6, level, times)

    assert 20 <= np.count_nonzero(creeping) <= 21
    assert 20 <= np.count_nonzero(turning) <= 21
