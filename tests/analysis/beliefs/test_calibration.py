"""A sensor's accuracies from known truth: counted by hand, and found again where they were made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs.sensor_calibration import SensorHits, calibrate, truths_of_rows
from semmap_log.analysis.beliefs.trials import StateIntervals
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.errors import EstimatorError

HOUR_NS = 3600 * 10**9
START_NS = 20_454 * 24 * HOUR_NS
DOOR = DoorId(1)


def at(hour: float) -> int:
    return START_NS + round(hour * HOUR_NS)


def truth(*stretches: tuple[float, float, bool]) -> dict[DoorId, StateIntervals]:
    start, end, is_open = zip(*stretches, strict=True)
    return {
        DOOR: StateIntervals(
            np.array([at(h) for h in start]), np.array([at(h) for h in end]), np.array(is_open)
        )
    }


def log_of(path: Path, *seen: tuple[float, str], source: str = "") -> sl.DoorLog:
    with sl.create(path / "log", tz="UTC") as log:
        log.add_door(name="front", at=at(-10))
        for hour, state in seen:
            log.observe(DOOR, state, accuracy=0.8, at=at(hour), source=source)
    return sl.read(path / "log")


TRIALS = {
    "open: two of three right; closed: one of one; outside of the known time nothing": (
        [(-1, "closed"), (1, "open"), (2, "closed"), (3, "open"), (11, "closed"), (20, "open")],
        [(0, 10, True), (10, 20, False)],
        SensorHits(2, 3, 3),
        SensorHits(1, 1, 1),
    ),
    "a burst of a hundred, three quarters of them right, is three quarters of a hit": (
        [*((1 + n / 36000, "closed" if n % 4 == 0 else "open") for n in range(100)), (5, "open")],
        [(0, 10, True)],
        SensorHits(1.75, 2, 101),
        SensorHits(),
    ),
    "a pass in which the door closes is a visit to each state": (
        [(1 + n / 360, "open" if n < 5 else "closed") for n in range(10)],
        [(0, 1 + 5 / 360, True), (1 + 5 / 360, 9, False)],
        SensorHits(1, 1, 5),
        SensorHits(1, 1, 5),
    ),
}


@pytest.mark.parametrize("case", TRIALS)
def test_visits_are_counted_by_the_true_state(tmp_path: Path, case: str) -> None:
    seen, known, when_open, when_closed = TRIALS[case]
    found = calibrate(log_of(tmp_path, *seen), truth(*known))

    assert (when_open, when_closed) == (found.together.when_open, found.together.when_closed)
    assert found.doors[DOOR] == found.together


def test_only_one_source_counts_if_asked(tmp_path: Path) -> None:
    """Each sensor has accuracies of its own."""
    log_of(tmp_path, (1, "open"), (2, "open"), source="lidar")
    with sl.append(tmp_path / "log") as log:
        log.observe(DOOR, "closed", at=at(3), source="camera")
    log = sl.read(tmp_path / "log")

    lidar, both = (calibrate(log, truth((0, 9, True)), source=s) for s in ("lidar", None))

    assert SensorHits(2, 2, 2) == lidar.together.when_open
    assert SensorHits(2, 3, 3) == both.together.when_open
    with pytest.raises(EstimatorError, match="sightings of source 'sonar'"):
        calibrate(log, truth((0, 9, True)), source="sonar")


def test_made_accuracies_are_found_again(tmp_path: Path) -> None:
    """2,000 visits by a sensor right 93 % when open, 71 % when closed: both in their intervals."""
    rng = np.random.default_rng(8)
    hours = np.arange(2000) * 1.0
    is_open = hours // 5 % 2 == 0
    reads = np.where(is_open, rng.random(2000) < 0.93, rng.random(2000) >= 0.71)
    rows = "".join(
        f"{np.datetime64(at(h), 'ns')},front,{'OPEN' if r else 'CLOSED'},0.9\n"
        for h, r in zip(hours + 0.5, reads, strict=True)
    )
    (tmp_path / "seen.csv").write_text("timestamp,door,state,accuracy\n" + rows)
    log_of(tmp_path)
    from semmap_log.interop.importing.importing import import_file

    with sl.append(tmp_path / "log") as log:
        import_file(log, tmp_path / "seen.csv")
    known = truth(*[(float(h), float(h) + 5, h % 10 == 0) for h in range(0, 2000, 5)])

    found = calibrate(sl.read(tmp_path / "log"), known).together

    for hits, made in ((found.when_open, 0.93), (found.when_closed, 0.71)):
        low, high = hits.interval
        assert 1000 == hits.visits
        assert low < made < high
        assert high - low < 0.06
        assert pytest.approx(made, abs=0.03) == hits.declared


def test_what_is_declared_is_never_certain_nor_below_a_half() -> None:
    """Ten of ten right is no proof of a sensor without faults; none right is no sensor."""
    assert pytest.approx(10.5 / 11) == SensorHits(10, 10, 10).declared
    assert 0.5 == SensorHits(0, 10, 10).declared
    assert SensorHits().declared is None


def test_rows_hold_until_the_next_one() -> None:
    """The last row ends what is known; UNKNOWN is no truth."""
    states = [DoorState.OPEN, DoorState.UNKNOWN, DoorState.CLOSED, DoorState.OPEN]

    found = truths_of_rows(
        {"front": (np.array([1, 5, 7, 9]), np.array(states, np.uint8))}, {"front": DOOR}
    )[DOOR]

    assert [(1, 5, True), (7, 9, False)] == list(
        zip(found.start_ns, found.end_ns, found.is_open, strict=True)
    )


def test_nothing_seen_in_the_known_time_is_an_error(tmp_path: Path) -> None:
    """It says where to look: most often the zone is wrong."""
    log = log_of(tmp_path, (50, "open"))

    with pytest.raises(
        EstimatorError, match=r"nothing to calibrate.*the zone of the truth's times"
    ):
        calibrate(log, truth((0, 9, True)))
