"""Where the filter says that P(open) lies, some hours after the door was seen, it mostly lies."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.probabilities.evidence.evidence import Evidence
from semmap_log.analysis.probabilities.methods.filter import Filter
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import Changed, DoorAdded, DoorUpdated
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.known import HOUR_NS, hours_ns

DOOR = DoorId(1)
DAYS, DOORS = 14, 20
STEPS_H = 4
HOURS = np.arange((DAYS + 1) * 24 * STEPS_H) / STEPS_H
IS_DAY = (HOURS % 24 >= 8) & (HOURS % 24 < 18)
TENDS_TO = np.where(IS_DAY, 0.9, 0.05)


@pytest.mark.parametrize(("ahead_h", "by_day_h"), [(3, 12.0), (6, 12.0), (1, 2.0)])
def test_the_truth_lies_in_the_interval_about_as_often_as_is_said(
    ahead_h: int, by_day_h: float
) -> None:
    """For simulated doors P(open) is known exactly: it mostly lies in there."""
    keeps = np.exp(-1 / STEPS_H / np.where(IS_DAY, by_day_h, 12.0))
    known = np.arange(9 * 24 * STEPS_H, DAYS * 24 * STEPS_H, 7)
    doors = simulated(keeps, np.random.default_rng(1))
    truth = doors[:, known].astype(float)
    for step in range(1, ahead_h * STEPS_H + 1):
        here = keeps[known + step]
        truth = (1 - here) * TENDS_TO[known + step] + here * truth
    known_ns = hours_ns(known / STEPS_H)
    inside = []

    for is_open, expected in zip(doors, truth, strict=True):
        learnt = Filter().learn(told(is_open[: DAYS * 24 * STEPS_H]).up_to(), LocalClock("UTC"))
        found = learnt.predict(DOOR, known_ns + ahead_h * HOUR_NS, known_ns)
        inside.append((found.low <= expected) & (expected <= found.high))

    assert 0.72 <= np.mean(inside) <= 0.98


def simulated(keeps: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return whether each door is open, (doors, steps), that keeps its state so far a step."""
    doors = np.zeros((DOORS, len(HOURS)), np.bool_)
    for step, tends_to in enumerate(TENDS_TO[1:], 1):
        p_open = (1 - keeps[step]) * tends_to + keeps[step] * doors[:, step - 1]
        doors[:, step] = rng.random(DOORS) < p_open
    return doors


def told(is_open: np.ndarray) -> Evidence:
    """Return the evidence of a door that was set every quarter of an hour."""
    evidence = Evidence()
    times_ns = hours_ns(np.arange(len(is_open)) / 4)
    evidence.apply(EventBatch.of(DoorAdded, happened_ns=times_ns[:1], door_id=DOOR))
    evidence.apply(
        EventBatch.of(
            DoorUpdated, happened_ns=times_ns, door_id=DOOR, changed=Changed.STATE.value,
            state=np.where(is_open, 1, 2).astype(np.uint8),
        )
    )  # fmt: skip
    return evidence
