"""Whoever asks what to believe is told of sensors that are not as accurate as declared."""

from __future__ import annotations

import json
import shlex
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs import best_time, by_name, evaluate, probabilities, typical_weeks
from semmap_log.cli import main
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved
from semmap_log.errors import SensorWarning
from tests.conftest import SteadyClock

FIRST_NS = 1_772_323_200 * 10**9
DAYS, DOORS = 14, 5
END_NS = FIRST_NS + DAYS * 86400 * 10**9


def observed(path: Path, right: float) -> sl.DoorLog:
    """Return a log of a lidar that is declared .95: doors open by day, looked at in threes."""
    rng = np.random.default_rng(4)
    with sl.create(path, tz="UTC", clock=SteadyClock(END_NS)) as log:
        log.append([DoorAdded(door_id=DoorId(d), x=0, y=0, theta=0, width=1, happened_ns=FIRST_NS)
                    for d in range(1, DOORS + 1)])  # fmt: skip
        for door in range(1, DOORS + 1):
            log.append(list(readings(rng, DoorId(door), right)), note=sl.Note(source="lidar"))
    return sl.read(path)


def readings(rng: np.random.Generator, door: DoorId, right: float) -> list[DoorObserved]:
    return [
        DoorObserved(
            door_id=door, accuracy_open=0.95, accuracy_closed=0.95,
            state=DoorState.OPEN if (8 <= half // 2 % 24 < 18) == (rng.random() < right)
            else DoorState.CLOSED,
            happened_ns=FIRST_NS + (half * 1800 + 60 * door + 4 * look) * 10**9,
        )
        for half in range(1, DAYS * 48)
        for look in range(3)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def wrong(tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    """A log whose sensor is right .8 of the time, and is declared .95."""
    return observed(tmp_path_factory.mktemp("wrong") / "log", 0.8)


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    """A log whose sensor is as declared."""
    return observed(tmp_path_factory.mktemp("good") / "log", 0.95)


NOW = f"@{END_NS}"

QUESTIONS: dict[str, Callable[[sl.DoorLog], object]] = {
    "probabilities": lambda log: probabilities(log, at=NOW),
    "as happened": lambda log: probabilities(log, at=NOW, as_happened=True),
    "typical weeks": lambda log: typical_weeks(log, at=NOW),
    "evaluate": lambda log: evaluate(log, [by_name("last")]),
}


@pytest.mark.parametrize("question", list(QUESTIONS))
def test_who_asks_is_warned_with_the_numbers_and_what_to_do(
    wrong: sl.DoorLog, question: str
) -> None:
    """Declared, seen with its interval, and how far P(open) may be off."""
    with pytest.warns(SensorWarning) as told:
        found = QUESTIONS[question](wrong)

    (warning,) = told
    text = str(warning.message)
    assert "sensor 'lidar'" in text
    assert "0.95 declared, 0." in text
    assert "P(open) may be 0." in text
    assert f"semmap-log calibrate {wrong.path} --truth FILE.csv --source lidar" in text
    (doubt,) = found.sensor_doubts  # type: ignore[attr-defined]
    assert 0.8 == pytest.approx(doubt.when_closed.accuracy, abs=0.05)


@pytest.mark.parametrize("question", list(QUESTIONS))
def test_who_declared_it_rightly_hears_nothing(good: sl.DoorLog, question: str) -> None:
    """Neither a warning nor a doubt."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = QUESTIONS[question](good)

    assert [] == list(found.sensor_doubts)  # type: ignore[attr-defined]


def test_one_door_alone_tells_nothing_of_its_sensor(wrong: sl.DoorLog) -> None:
    """It may flicker: `best-time` of it says so only where no door could."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", SensorWarning)

        assert () == tuple(best_time(wrong, DoorId(1), at=NOW).sensor_doubts)


def test_the_numbers_stay_those_of_what_is_declared(wrong: sl.DoorLog) -> None:
    """A sensor's accuracy is what somebody declares: nothing is put in its place."""
    with pytest.warns(SensorWarning):
        together = probabilities(wrong, at=NOW)

    alone = [probabilities(wrong, at=NOW, doors=[belief.door.door_id])[0] for belief in together]
    assert [belief.p_open for belief in alone] == [belief.p_open for belief in together]


@pytest.mark.parametrize("verb", ["probabilities LOG", "probabilities LOG --by hour",
                                  "evaluate LOG --estimator last"])  # fmt: skip
def test_people_get_a_line_and_machines_a_field(
    wrong: sl.DoorLog, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    """On stderr, and in the document of --json."""
    with pytest.raises(SystemExit) as left:
        main([str(wrong.path) if word == "LOG" else word for word in shlex.split(f"{verb} --json")])

    assert 0 == left.value.code
    told = capsys.readouterr()
    (doubt,) = json.loads(told.out)["sensor_doubts"]
    assert {"declared": 0.95, "by": "repeats"}.items() <= doubt["accuracy_closed"].items()
    assert ("lidar", DOORS) == (doubt["source"], doubt["doors"])
    assert told.err.startswith("semmap-log: warning: sensor 'lidar': its accuracy is not what")
