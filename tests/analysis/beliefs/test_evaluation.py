"""Evaluations of small logs whose answers are known, and of the real data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs.evaluation import evaluate, evaluate_all
from semmap_log.analysis.beliefs.protocol import Patrol, Protocol
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import Forecast
from semmap_log.analysis.probabilities.methods.baselines import CONSTANT, HOUR_OF_DAY, HOUR_OF_WEEK
from semmap_log.analysis.probabilities.methods.fremen import Fremen
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorUpdated
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.errors import EstimatorError
from semmap_log.interop.importing.importing import ImportOptions, import_file

HOUR_NS = 3600 * 10**9
DAY_NS = 24 * HOUR_NS
START_NS = 20_454 * DAY_NS  # 2026-01-01


@dataclass
class Asked:
    """A method that says a half, and remembers what it was asked."""

    name: str = "asked"
    times: dict[int, np.ndarray] = field(default_factory=dict)
    known: dict[int, np.ndarray] = field(default_factory=dict)
    evidence: dict[int, DoorEvidence] = field(default_factory=dict)

    def learn(self, evidence: Mapping[DoorId, DoorEvidence], clock: LocalClock) -> Asked:
        self.evidence = dict(evidence)
        return self

    def predict(self, door_id: DoorId, times_ns: np.ndarray, known_ns: np.ndarray) -> Forecast:
        self.times[door_id], self.known[door_id] = times_ns, known_ns
        half = np.full(len(times_ns), 0.5)
        return Forecast.of(half, half, half, np.ones(len(half), np.bool_))


def log_of(path: Path, events: Mapping[int, list[tuple[float, str]]], **how: float) -> sl.DoorLog:
    """Return a log of doors whose states were set, or seen with an accuracy, at hours."""
    with sl.create(path / "log", tz="Europe/Vienna") as log:
        for door_id, told in events.items():
            times = START_NS + np.round(np.array([h for h, _ in told]) * HOUR_NS).astype(np.int64)
            states = np.array([DoorState[s].value for _, s in told], np.uint8)
            log.append(
                [
                    EventBatch.of(DoorAdded, happened_ns=times[:1], door_id=door_id),
                    EventBatch.of(
                        DoorObserved if how else DoorUpdated,
                        happened_ns=times,
                        door_id=door_id,
                        state=states,
                        **(how or {"changed": 4}),
                    ),
                ]
            )
    return sl.read(path / "log")


def office_hours(days: int) -> list[tuple[float, str]]:
    """Open from nine to five UTC, each day."""
    told = [(24.0 * d + h, s) for d in range(days) for h, s in [(9, "OPEN"), (17, "CLOSED")]]
    return [(0.0, "CLOSED"), *told, (24.0 * days, "UNKNOWN")]


def test_a_frozen_evaluation_is_the_protocols(tmp_path: Path) -> None:
    """Ten days: seven teach, three are forecast, each minute, from what was known at the split."""
    log, asked = log_of(tmp_path, {1: office_hours(10)}), Asked()

    found = evaluate(log, [asked, CONSTANT, HOUR_OF_DAY])

    minutes = np.arange(7 * 1440, 10 * 1440) * 60 * 10**9 + START_NS
    assert minutes.tolist() == asked.times[1].tolist()
    assert {START_NS + 7 * DAY_NS} == set(asked.known[1].tolist())
    assert (7 * 1440, 3 * 1440) == (found.doors[0].training, found.doors[0].tests)
    assert found.is_truth
    assert pytest.approx(0.25) == found.mean["asked"].brier
    assert pytest.approx(1 / 3 * 2 / 3) == found.mean["constant"].brier
    assert pytest.approx(0, abs=1e-6) == found.mean["constant"].bias
    assert pytest.approx(1e-6) == found.mean["hour_of_day"].brier


def test_prequential_knows_the_days_that_are_over(tmp_path: Path) -> None:
    """Up to the local midnight: in Vienna that is an hour before the one of UTC."""
    log, asked = log_of(tmp_path, {1: office_hours(10)}), Asked()

    evaluate(log, [asked], Protocol(prequential=True))

    midnight_ns = (asked.times[1] + HOUR_NS) // DAY_NS * DAY_NS - HOUR_NS
    assert midnight_ns.tolist() == asked.known[1].tolist()


def test_a_horizon_knows_all_up_to_then(tmp_path: Path) -> None:
    """The state an hour ago; with prequential the midnight before that."""
    log, asked = log_of(tmp_path, {1: office_hours(10)}), Asked()

    evaluate(log, [asked], Protocol(horizon_ns=HOUR_NS))
    live = asked.times[1] - asked.known[1]
    evaluate(log, [asked], Protocol(horizon_ns=HOUR_NS, prequential=True))
    daily_ns = asked.times[1] // DAY_NS * DAY_NS - HOUR_NS

    assert {HOUR_NS} == set(live.tolist())
    assert daily_ns.tolist() == asked.known[1].tolist()


def test_a_horizon_asks_where_the_state_was_known_then(tmp_path: Path) -> None:
    """Six hours after the end of a gap no state was known six hours ago: there is no forecast."""
    told = [*office_hours(8)[:-1], (24.0 * 8, "UNKNOWN"), (24.0 * 8 + 20, "OPEN")]
    log = log_of(tmp_path, {1: [*told, (24.0 * 10, "UNKNOWN")]})
    asked = Asked()

    found = evaluate(log, [asked], Protocol(horizon_ns=6 * HOUR_NS))

    hours = (asked.times[1] - START_NS) / HOUR_NS - 24 * 8
    assert found.doors[0].tests == len(hours)
    assert not ((hours >= 6) & (hours < 26)).any()
    assert pytest.approx([26, 48 - 1 / 60]) == hours[hours >= 6][[0, -1]]


def test_a_patrol_knows_what_it_read_up_to_the_forecast(tmp_path: Path) -> None:
    """A visit each half an hour reads right nine times in ten; the truth stays unknown."""
    log, asked = log_of(tmp_path, {1: office_hours(100)}), Asked()

    evaluate(log, [asked], Protocol(patrol=Patrol(seed=3)))

    known = asked.evidence[1]
    hour = known.seen_ns % DAY_NS / HOUR_NS
    is_open = (hour >= 9) & (hour < 17)
    assert asked.times[1].tolist() == asked.known[1].tolist()
    assert (0, 4800) == (len(known.start_ns), int(known.is_visit.sum()))
    assert {HOUR_NS // 2} == set(np.diff(known.seen_ns).tolist())
    assert pytest.approx(0.9, abs=0.015) == np.mean(known.reads_open == is_open)
    assert {0.9} == set(known.accuracy_open.tolist())


def test_a_patrols_errors_are_its_seeds(tmp_path: Path) -> None:
    """The same again for the same seed, whichever other doors there are; others for another."""
    log = log_of(tmp_path, {1: office_hours(20), 2: office_hours(20)})

    def read(seed: int, *doors: int) -> list[bool]:
        asked = Asked()
        evaluate(log, [asked], Protocol(patrol=Patrol(seed=seed)), doors=doors)
        return asked.evidence[2].reads_open.tolist()

    assert read(1, 1, 2) == read(1, 2)
    assert read(1, 2) != read(2, 2)


def test_gaps_are_neither_asked_nor_taught(tmp_path: Path) -> None:
    """While a state is UNKNOWN, MOVING or OFFLINE there is no sample."""
    told = [(0.0, "CLOSED"), (10, "UNKNOWN"), (100, "OPEN"), (110, "MOVING"), (111, "OFFLINE")]
    log, asked = log_of(tmp_path, {1: told}), Asked()

    found = evaluate(log, [asked], Protocol(split=0.5))

    assert (600, 600) == (found.doors[0].training, found.doors[0].tests)
    hours = (asked.times[1][[0, -1]] - START_NS) / HOUR_NS
    assert pytest.approx([100, 110 - 1 / 60]) == hours


def test_the_mean_is_over_doors_and_short_ones_are_left_out(tmp_path: Path) -> None:
    """With less than 200 minutes to learn from, or 100 to forecast, a door does not count."""
    log = log_of(
        tmp_path,
        {
            1: [(0.0, "CLOSED"), (20, "UNKNOWN")],
            2: office_hours(9),
            3: [(0.0, "OPEN"), (5.4, "UNKNOWN")],
        },
    )

    found = evaluate(log, [CONSTANT], Protocol(split=0.7))

    assert [1, 2] == [door.door_id for door in found.doors]
    assert {3: "226 to learn from, 98 to forecast"} == found.left_out
    each = [door.scores["constant"].brier for door in found.doors]
    assert pytest.approx(sum(each) / 2) == found.mean["constant"].brier
    assert found.reliability["constant"].count.sum() == sum(door.tests for door in found.doors)


def test_a_range_bounds_what_is_forecast(tmp_path: Path) -> None:
    """The split is of the known time within it."""
    log, asked = log_of(tmp_path, {1: office_hours(30)}), Asked()

    evaluate(log, [asked], since=START_NS + 10 * DAY_NS, until=START_NS + 20 * DAY_NS)

    days = (asked.times[1][[0, -1]] - START_NS) / DAY_NS
    assert pytest.approx([17, 20 - 1 / 1440]) == days


def test_of_a_log_of_sightings_the_next_one_is_forecast(tmp_path: Path) -> None:
    """Each visit, from what was known before it; P of the reading, not of the door's state."""
    rng = np.random.default_rng(1)
    told = [(h / 2, "OPEN" if rng.random() < 0.5 else "CLOSED") for h in range(100)]
    log = log_of(tmp_path, {1: told}, accuracy_open=0.9, accuracy_closed=0.7)
    asked = Asked()

    found = evaluate(log, [asked])

    assert not found.is_truth
    assert (70, 30) == (found.doors[0].training, found.doors[0].tests)
    assert {1} == set((asked.times[1] - asked.known[1]).tolist())
    outcome = np.array([s == "OPEN" for _, s in told[70:]], float)
    p_reads_open = 0.5 * 0.9 + 0.5 * (1 - 0.7)
    assert pytest.approx(np.mean((p_reads_open - outcome) ** 2)) == found.mean["asked"].brier


def test_a_visit_is_forecast_once(tmp_path: Path) -> None:
    """A burst of sightings in a pass is one visit."""
    told = [(h + second / 3600, "OPEN") for h in range(50) for second in range(10)]
    log = log_of(tmp_path, {1: told}, accuracy_open=0.9, accuracy_closed=0.9)

    found = evaluate(log, [CONSTANT])

    assert (35, 15) == (found.doors[0].training, found.doors[0].tests)


def test_nothing_to_evaluate_is_said(tmp_path: Path) -> None:
    """A log with too little says how much is wanted, an empty one too."""
    log = log_of(tmp_path, {1: [(0.0, "OPEN"), (1, "UNKNOWN")]})

    with pytest.raises(EstimatorError, match=r"200 samples .* doors with fewer: 1"):
        evaluate(log, [CONSTANT])


def test_a_patrol_needs_a_truth(tmp_path: Path) -> None:
    """Of a log of sightings nobody knows what a robot would have read."""
    told = [(float(h), "OPEN") for h in range(100)]
    log = log_of(tmp_path, {1: told}, accuracy_open=0.9, accuracy_closed=0.9)

    with pytest.raises(EstimatorError, match="mostly sightings; evaluate it without a patrol"):
        evaluate(log, [CONSTANT], Protocol(patrol=Patrol()))


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"split": 0.0}, "split: expected a share between 0 and 1, got 0"),
        ({"split": 1.5}, r"got 1\.5"),
        ({"step_s": 0.0}, "step: expected 1 s to a hundred years, got 0"),
        ({"step_s": math.inf}, "step: expected 1 s to a hundred years, got inf"),
        ({"horizon_ns": -1}, "horizon: expected 0 s to a hundred years"),
        ({"horizon_ns": 10**20}, "horizon: expected 0 s to a hundred years, got 1e"),
        ({"patrol": Patrol(accuracy=0.4)}, r"accuracy: expected 0\.5\.\.1, got 0\.4"),
        ({"patrol": Patrol(interval_ns=5)}, "patrol: expected 1 s to a hundred years between"),
        ({"patrol": Patrol(interval_ns=10**20)}, "patrol: expected 1 s to a hundred years between"),
    ],
)
def test_a_protocol_that_cannot_be_is_refused(values: dict[str, object], said: str) -> None:
    """With what was expected, and what was got."""
    with pytest.raises(EstimatorError, match=said):
        Protocol(**values)


def test_progress_reaches_its_end(tmp_path: Path) -> None:
    """A word for each door, estimator and protocol."""
    log = log_of(tmp_path, {1: office_hours(5), 2: office_hours(5)})
    told: list[tuple[int, int]] = []

    evaluate_all(
        log,
        [CONSTANT, HOUR_OF_DAY],
        {"frozen": Protocol(), "patrol": Protocol(patrol=Patrol())},
        progress=lambda done, total: told.append((done, total)),
    )

    assert [(n, 8) for n in range(1, 9)] == told


NOTE = {
    "workshop_3y": ("Europe/Oslo", 60.0, (0.1519, 0.1201, 0.1124, 0.1163)),
    "office_9d": ("UTC", 60.0, (0.1806, 0.1361, 0.1080, 0.0950)),
    "home_b": ("Europe/Amsterdam", 60.0, (0.0813, 0.0969, 0.1205, 0.1087)),
    "home_e": ("America/New_York", 60.0, (0.0676, 0.0679, 0.1258, 0.1000)),
    "spaces_polled": ("UTC", 600.0, (0.1229, 0.1080, 0.1762, 0.1437)),
}
"""Zone, step in seconds, and the Brier scores of `notes/probabilities.md`."""


@pytest.mark.parametrize("name", list(NOTE))
def test_published_figures_come_out_again(name: str, shared_data: Path, tmp_path: Path) -> None:
    """Constant, hour-of-day, hour-of-week and FreMEn 5, frozen at the split, on real doors."""
    tz, step_s, expected = NOTE[name]
    folder = shared_data / "doors" / name
    with sl.create(tmp_path / "log", tz=tz) as log:
        options = ImportOptions(windows=folder / "obs_windows.csv")
        import_file(log, folder / "doors.csv.gz", options)

    found = evaluate(
        sl.read(tmp_path / "log"),
        [CONSTANT, HOUR_OF_DAY, HOUR_OF_WEEK, Fremen(5)],
        Protocol(step_s=step_s),
    )

    briers = [scores.brier for scores in found.mean.values()]
    assert pytest.approx(expected, abs=0.0008) == briers
    assert pytest.approx(expected[0], abs=0.00006) == briers[0]
