"""Cases: probabilities of doors, from visits, from many sightings, and now."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmark import plain_beliefs
from benchmark.belief_forecasts import clinic_case
from benchmark.case import Case, Near, Peer, Work
from benchmark.patrol import START_NS
from benchmark.peers import OURS, on_cores
from semmap_log.analysis.probabilities.chain import hour_modes
from semmap_log.analysis.probabilities.chain.looks import HourLooks, Looks
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence, Evidence
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved
from semmap_log.core.model.local_clock import LocalClock

HOUR_NS = 3600 * 10**9
CLOCK = LocalClock("UTC")
LLR = float(np.log(0.9 / 0.1))


def visits_case(count: int, rounds: int | None) -> Case:
    """Return: the likelihoods of one door's visits in all modes, hour by hour, on one core."""
    expected = Near(tuple(_explained(_visits(count))), 1e-6)
    peers = (
        Peer(
            on_cores(OURS, 1),
            partial(_ours_by_visits, count),
            expected,
            cores=1,
            promise="< 1000 ms",
        ),
        Peer("plain Python, visit by visit", partial(_plain_by_visits, count), expected, cores=1),
    )
    title = f"What visits tell of hours, {count:,} visits"
    return Case("beliefs", title, "ms", peers, rounds or 1, warms_up=False)


def _ours_by_visits(count: int) -> Work:
    visits = _visits(count)
    return Work(
        lambda _: HourLooks(visits, CLOCK).explained(None),
        answer=lambda found: tuple(found.sum(0).tolist()),
    )


def _plain_by_visits(count: int) -> Work:
    visits = _visits(count)
    return Work(lambda _: _explained(visits))


def _explained(visits: Looks) -> list[float]:
    return plain_beliefs.explained(
        CLOCK.hour_of(visits.times_ns - visits.gap_ns // 2).tolist(),
        (visits.gap_ns / HOUR_NS).tolist(),
        visits.llr.tolist(),
        list(zip(hour_modes.SHARE.tolist(), hour_modes.PER_H.tolist(), strict=True)),
    )


def _visits(count: int) -> Looks:
    """Return about half-hourly looks, of which two in three read closed."""
    rng = np.random.default_rng(count)
    times_ns = np.cumsum(rng.integers(600, 3000, count)) * 10**9
    llr = np.where(rng.random(count) < 1 / 3, LLR, -LLR)
    return Looks(times_ns, llr, np.arange(1, count + 1))


DOORS = 100
ACCURACY = 0.9
PART = 10
"""The slow peer is given that part."""
ROUNDS = 3


def sightings_case(count: int, rounds: int | None) -> Case:
    """Return: sightings of a hundred doors, as columns of events, made evidence of each door."""
    few = count // PART
    plain = plain_beliefs.visits(_as_tuples(*_sightings(count)))
    peers = (
        Peer(on_cores(OURS, 1), partial(_ours, count), Near(plain, 1e-6), count,
             cores=1),
        Peer(f"plain Python, 1/{PART} of it", partial(_plain, few),
             Near(_of_evidence(_folded(_batches(few))), 1e-6), few, cores=1),
    )  # fmt: skip
    title = f"Evidence of {count:,} sightings"
    return Case("beliefs", title, "sightings/s", peers, rounds or ROUNDS,
                memory_promise=False)  # fmt: skip


def _ours(count: int) -> Work:
    batches = _batches(count)
    return Work(lambda _: _folded(batches), answer=_of_evidence)


def _plain(count: int) -> Work:
    sightings = _as_tuples(*_sightings(count))
    return Work(lambda _: plain_beliefs.visits(sightings))


def _folded(batches: list[EventBatch]) -> list[DoorEvidence]:
    evidence = Evidence()
    for batch in batches:
        evidence.apply(batch)
    return [evidence.door(door_id) for door_id in evidence.door_ids]


def _of_evidence(doors: list[DoorEvidence]) -> tuple[float, float]:
    """Return how many visits there are, and the sum of what they tell."""
    return sum(int(d.is_visit.sum()) for d in doors), sum(float(d.llr.sum()) for d in doors)


def _sightings(count: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return (door, seconds, reads open): a robot that looks some times at each door it passes."""
    rng = np.random.default_rng(count)
    door = np.repeat(np.arange(count // 4 + 1) % DOORS + 1, rng.integers(1, 8, count // 4 + 1))
    door = np.resize(door, count)
    new = np.diff(door, prepend=0) != 0
    seen_s = np.cumsum(np.where(new, rng.integers(5, 200, count), rng.integers(1, 80, count)))
    return door, seen_s, rng.random(count) < 0.4


def _batches(count: int) -> list[EventBatch]:
    door, seen_s, reads_open = _sightings(count)
    added = EventBatch.of(DoorAdded, happened_ns=START_NS, door_id=np.arange(1, DOORS + 1))
    return [
        added,
        EventBatch.of(
            DoorObserved,
            happened_ns=START_NS + seen_s * 10**9,
            door_id=door,
            state=np.where(reads_open, DoorState.OPEN, DoorState.CLOSED).astype(np.uint8),
            accuracy_open=ACCURACY,
            accuracy_closed=ACCURACY,
        ),
    ]


def _as_tuples(
    door: NDArray[Any], seen_s: NDArray[Any], reads_open: NDArray[Any]
) -> list[plain_beliefs.Sighting]:
    right = [ACCURACY] * len(door)
    return list(zip(door.tolist(), seen_s.tolist(), reads_open.tolist(), right, right, strict=True))


VISITS, SIGHTINGS = 8736, 1_000_000
"""Visits: half a year of two an hour."""
TRIED_OUT = 100
"""A run that only tries out has that part of each."""
FEW_DOORS = 12


def belief_cases(rounds: int | None, *, tries_out: bool = False) -> Iterator[Case]:
    """Yield: what visits tell; sightings as evidence; all doors of a log.

    Args:
        rounds: Rounds that count; None: each case's own.
        tries_out: Only a small part of each, to see whether everything works.
    """
    part = TRIED_OUT if tries_out else 1
    yield visits_case(VISITS // part, rounds)
    yield sightings_case(SIGHTINGS // part, rounds)
    yield clinic_case(rounds, most=FEW_DOORS if tries_out else None)
