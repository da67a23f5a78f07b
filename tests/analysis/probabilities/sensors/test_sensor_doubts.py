"""A declared accuracy is doubted where readings contradict it, not because a door flickers."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.probabilities.evidence.evidence import Evidence
from semmap_log.analysis.probabilities.sensors.sensor_doubts import SensorDoubt, sensor_doubts
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorPassed

SECOND_NS = 10**9
FIRST_NS = 1_772_323_200 * SECOND_NS
"""2026-03-01T00:00Z, a Sunday."""
DAYS = 14
EVERY_S = 1800
DWELL_S = {"slow": (4 * 3600, 6 * 3600), "busy": (120, 300), "flicker": (15, 25)}
"""Mean seconds open, and closed."""
SEEDS = range(8)
FEW_SEEDS = range(3)


def truth(kind: str, rng: np.random.Generator, times_s: np.ndarray) -> np.ndarray:
    """Return whether a door of that kind is open at some times."""
    if kind in ("open", "closed"):
        return np.full(times_s.shape, kind == "open")
    hour, day = times_s / 3600 % 24, (times_s // 86400).astype(int)
    if kind == "office":
        opens, closes = rng.uniform(7, 9), rng.uniform(16, 19)
        late = rng.normal(0, 0.3, DAYS + 1)[day]
        return (hour > opens + late) & (hour < closes + late) & ((day + 6) % 7 < 5)
    if kind == "pulse":  # somebody comes each 40 s, by day, and the door stays open for 8 s
        comes = np.cumsum(rng.exponential(40, DAYS * 86400 // 30))
        last = comes[np.maximum(np.searchsorted(comes, times_s) - 1, 0)]
        return (times_s >= last) & (times_s - last < 8) & (hour > 7) & (hour < 19)
    stays_open, stays_closed = DWELL_S[kind]
    count = int(DAYS * 86400 / min(stays_open, stays_closed)) + 10
    means = np.where(np.arange(count) % 2 == 0, stays_closed, stays_open)
    changes = np.cumsum(rng.exponential(means))
    return np.searchsorted(changes, times_s) % 2 == 1


def patrolled(
    kinds: list[str],
    seed: int,
    *,
    right: tuple[float, float] = (0.9, 0.9),
    declared: tuple[float, float] = (0.9, 0.9),
    repeats: int = 3,
    gap_s: float = 5,
    together: float = 0.0,
    passes: bool = False,
) -> list[SensorDoubt]:
    """Return the doubts about a sensor after two weeks of visits each half hour.

    Args:
        kinds: Of the doors.
        seed: Of all that is random.
        right: How accurate the sensor is, when open and when closed.
        declared: What is said about that.
        repeats: Readings of a visit.
        gap_s: Seconds between two of them.
        together: The share of the visits whose readings all err, or none does.
        passes: The robot goes through the doors that it finds open.
    """
    rng, evidence = np.random.default_rng(seed), Evidence()
    for place, kind in enumerate(kinds):
        visits_s = np.arange(60, DAYS * 86400, EVERY_S) + rng.uniform(0, 600)
        times_s = visits_s[:, None] + gap_s * np.arange(repeats)
        is_open = truth(kind, rng, times_s)
        luck = rng.random(times_s.shape)
        luck = np.where(rng.random((len(luck), 1)) < together, luck[:, :1], luck)
        reads_open = is_open ^ (luck >= np.where(is_open, *right))
        times_ns = FIRST_NS + (times_s * SECOND_NS).astype(np.int64)
        door = DoorId(place + 1)
        evidence.apply(EventBatch.of(DoorAdded, happened_ns=times_ns[:1, 0], door_id=door))
        evidence.apply(
            EventBatch.of(
                DoorObserved, happened_ns=times_ns.ravel(), door_id=door,
                state=np.where(reads_open, 1, 2).ravel().astype(np.uint8),
                accuracy_open=declared[0], accuracy_closed=declared[1],
            )
        )  # fmt: skip
        if passes:
            went_ns = times_ns[is_open[:, 0], 0] + SECOND_NS
            evidence.apply(EventBatch.of(DoorPassed, happened_ns=went_ns, door_id=door,
                                         passed=True, waited_s=0.0))  # fmt: skip
    return sensor_doubts(evidence, evidence.door_ids, 2**62)


MIXED = ["office"] * 4 + ["closed", "open", "slow", "busy"]


@pytest.mark.parametrize(
    "kinds", [["closed"], ["office"] * 4, ["slow"] * 4, ["busy"] * 4, ["flicker"] * 4, MIXED]
)
@pytest.mark.parametrize(
    "how",
    [
        {}, {"repeats": 1}, {"together": 0.5}, {"passes": True},
        {"right": (0.8, 0.95), "declared": (0.8, 0.95)}, {"right": (1, 1), "declared": (1, 1)},
    ],
)  # fmt: skip
def test_who_declares_what_is_true_is_never_told_otherwise(
    kinds: list[str], how: dict[str, object]
) -> None:
    """Whatever the doors do, also while they are looked at, and though readings err together."""
    assert [] == [doubt for seed in FEW_SEEDS for doubt in patrolled(kinds, seed, **how)]


@pytest.mark.parametrize("kinds", [["office"] * 4, ["slow"] * 4, MIXED, [*MIXED, "flicker"]])
@pytest.mark.parametrize("repeats", [3, 5])
def test_a_wrong_word_is_found_in_two_weeks_of_repeats(kinds: list[str], repeats: int) -> None:
    """Declared .9 both ways, truly .8 and .95: in at least nine of ten logs."""
    found = [patrolled(kinds, seed, right=(0.8, 0.95), repeats=repeats) for seed in range(10)]

    assert 9 <= sum(map(len, found))
    for doubt in (one for each in found for one in each):
        assert 0 <= doubt.p_open_off <= 0.15
        assert doubt.when_open.how in ("", "repeats")
        assert doubt.when_closed.how in ("", "neighbours")
        assert doubt.when_closed.low <= doubt.when_closed.accuracy <= doubt.when_closed.high


def test_both_words_are_told_with_what_was_seen() -> None:
    """The accuracies are near the true ones, and the message names them and the door."""
    found = [patrolled(["office"] * 8, seed, right=(0.8, 0.95), repeats=5)[0] for seed in SEEDS]

    of_open = [doubt.when_open.accuracy for doubt in found if doubt.when_open.how]
    of_closed = [doubt.when_closed.accuracy for doubt in found if doubt.when_closed.how]
    assert 0.8 == pytest.approx(np.mean(of_open), abs=0.02)
    assert 0.95 == pytest.approx(np.mean(of_closed), abs=0.01)
    doubt = next(one for one in found if one.when_open.how)
    assert (8, 8 * DAYS * 48 * 5) == (doubt.doors, doubt.readings)
    text = str(doubt)
    assert f"0.9 declared, {doubt.when_open.accuracy:.2f} (" in text
    assert "seen when open (by repeats)" in text
    assert f"too low (door {doubt.door_id})" in text


def test_certainty_that_is_none_is_found() -> None:
    """Declared certain, as sightings are by default, and wrong one time in twenty."""
    for seed in SEEDS:
        (doubt,) = patrolled(["office"] * 4, seed, right=(0.95, 0.95), declared=(1, 1))

        assert "repeats" == doubt.when_closed.how


def test_passages_tell_what_single_looks_cannot() -> None:
    """Who went through had an open door before him."""
    how = {"right": (0.8, 0.9), "repeats": 1}

    assert [] == [doubt for seed in SEEDS for doubt in patrolled(["office"] * 4, seed, **how)]
    for seed in SEEDS:
        (doubt,) = patrolled(["office"] * 4, seed, passes=True, **how)
        assert "passages" == doubt.when_open.how
        assert 0.8 == pytest.approx(doubt.when_open.accuracy, abs=0.06)


@pytest.mark.parametrize("kind", ["flicker", "pulse"])
@pytest.mark.parametrize("gap_s", [5, 20])
@pytest.mark.parametrize("right", [0.9, 0.99, 1.0])
def test_not_even_doors_that_all_move_while_they_are_looked_at_accuse_a_sensor(
    kind: str, gap_s: float, right: float
) -> None:
    """There the middle of three readings differs as often as if the sensor erred."""
    how = {"right": (right, right), "declared": (right, right), "gap_s": gap_s}

    assert [] == [doubt for seed in FEW_SEEDS for doubt in patrolled([kind] * 4, seed, **how)]


def test_one_door_alone_may_flicker() -> None:
    """Its readings differ as those of a bad sensor would: no other door says so."""
    how = {"right": (0.8, 0.8), "declared": (0.95, 0.95), "repeats": 9}

    alone = [patrolled(["office"], seed, **how) for seed in SEEDS]

    assert [[]] * len(SEEDS) == alone


def test_sensors_are_judged_each_by_itself_and_by_what_was_known() -> None:
    """No reading of a door that is not asked about counts, nor one from later."""
    assert [] == sensor_doubts(Evidence(), [DoorId(1)], 2**62)
    evidence = Evidence()
    evidence.apply(EventBatch.of(DoorAdded, happened_ns=np.array([FIRST_NS]), door_id=1))
    assert [] == sensor_doubts(evidence, [DoorId(1)], 2**62)
