"""Case: a million sightings become the evidence of each door."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmark import plain_beliefs
from benchmark.case import Case, Peer, Work
from benchmark.near import Near
from benchmark.patrol import START_NS
from benchmark.peers import OURS, on_cores
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence, Evidence
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved

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
