"""Cases: how likely the doors of a recording are open now; and a door in each minute of years."""

from __future__ import annotations

from functools import cache, partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import semmap_log as sl
from benchmark import plain_beliefs
from benchmark.case import Case, Near, Peer, Work
from benchmark.peers import OURS, on_cores
from semmap_log.analysis.beliefs.door_beliefs import DoorBelief, ask, belief, probabilities
from semmap_log.analysis.probabilities.belief_fold import by_name
from semmap_log.analysis.probabilities.evidence.evidence import Evidence
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import Changed, DoorAdded, DoorUpdated
from semmap_log.core.model.local_clock import LocalClock

CLINIC = Path(__file__).resolve().parents[2] / "recordings" / "clinic_week"
MINUTE_NS = 60 * 10**9
DAY_MINUTES = 1440
MONDAY_NS = 20_458 * DAY_MINUTES * MINUTE_NS
"""2026-01-05T00:00Z."""
DOOR = DoorId(1)
ASKED = 5
"""So many of the minutes are asked for apart, of what was known then and nothing else."""
EACH = 6
"""So many doors are told from one to the next, where each is asked for by itself."""
ROUNDS = 2


def clinic_case(rounds: int | None, *, most: int | None) -> Case:
    """Return: how likely the doors of a shipped recording are open now, from the log on disk.

    Args:
        rounds: Rounds that count; None: `ROUNDS`.
        most: So many of its doors; None: all.
    """
    doors = sorted(sl.read(CLINIC).replay().doors)[:most]
    few = doors[::EACH]
    alone = _of_forecasts(_each_alone(few))
    peers = (
        Peer(OURS, partial(_at_once, doors), Near(alone, 0.01)),
        Peer(f"{OURS}, one by one, 1/{EACH}", partial(_alone, few), Near(alone, 1e-9),
             len(few) / len(doors)),
    )  # fmt: skip
    title = f"Now, {len(doors)} doors of a clinic"
    return Case("beliefs", title, "ms", peers, rounds or ROUNDS)


def _at_once(doors: list[DoorId]) -> Work:
    return Work(
        lambda _: probabilities(sl.read(CLINIC), doors=doors),
        answer=lambda said: _of_forecasts(said[::EACH]),
    )


def _alone(doors: list[DoorId]) -> Work:
    return Work(lambda _: _each_alone(doors), answer=_of_forecasts)


def _each_alone(doors: list[DoorId]) -> list[DoorBelief]:
    asked = ask(sl.read(CLINIC), at=None, estimator="filter", tz=None, doors=doors)
    return [belief(asked, door) for door in asked.doors]


def _of_forecasts(said: list[DoorBelief]) -> tuple[float, ...]:
    return tuple(one.p_open for one in said)


def minutes_case(days: int, rounds: int | None) -> Case:
    """Return: forecasts of each minute of years, as the midnight before each knew."""
    count = days * 1440
    peers = (
        Peer(on_cores(OURS, 1), partial(_by_method, "schedule", days),
             Near(_asked_apart("schedule", days), 1e-6), count, cores=1),
        Peer(f"FreMEn 5, {OURS}'s", partial(_by_method, "fremen5", days),
             Near(_asked_apart("fremen5", days), 1e-6), count, cores=1),
        Peer("plain Python, hours of the week", partial(_plain_minutes, days),
             Near(_asked_apart("hour_of_week", days), 1e-6), count, cores=1),
    )  # fmt: skip
    title = f"Schedule, {days * 1440:,} minutes"
    return Case("beliefs", title, "forecasts/s", peers, rounds or 1, memory_promise=False,
                warms_up=False)  # fmt: skip


def _by_method(name: str, days: int) -> Work:
    evidence, times_ns, known_ns = _minutes(days)
    told = evidence.up_to()

    def once(_: None) -> NDArray[np.float64]:
        learnt = by_name(name).learn(told, LocalClock("UTC"))
        return learnt.predict(DOOR, times_ns, known_ns).p_open

    return Work(once, answer=lambda said: tuple(said[_asked(days)].tolist()))


def _plain_minutes(days: int) -> Work:
    is_open = np.repeat(*_changes(days)).tolist()
    return Work(
        lambda _: plain_beliefs.hour_of_week(is_open),
        answer=lambda said: tuple(said[minute] for minute in _asked(days)),
    )


def _asked_apart(name: str, days: int) -> tuple[float, ...]:
    """Return what is said of some minutes, each learnt anew from what the midnight before knew."""
    evidence, times_ns, known_ns = _minutes(days)

    def said(minute: int) -> float:
        asked = slice(minute, minute + 1)
        learnt = by_name(name).learn(evidence.up_to(int(known_ns[minute])), LocalClock("UTC"))
        return float(learnt.predict(DOOR, times_ns[asked], known_ns[asked]).p_open[0])

    return tuple(map(said, _asked(days)))


def _asked(days: int) -> list[int]:
    return np.linspace(0, days * DAY_MINUTES - 1, ASKED + 1)[1:].astype(int).tolist()


@cache
def _minutes(days: int) -> tuple[Evidence, NDArray[np.int64], NDArray[np.int64]]:
    """Return a door's evidence, the middle of each minute, and the midnight before each."""
    is_open, minutes = _changes(days)
    begins = np.cumsum(minutes) - minutes
    evidence = Evidence()
    evidence.apply(EventBatch.of(DoorAdded, happened_ns=MONDAY_NS, door_id=DOOR))
    evidence.apply(
        EventBatch.of(
            DoorUpdated,
            happened_ns=MONDAY_NS + begins * MINUTE_NS,
            door_id=DOOR,
            changed=int(Changed.STATE),
            state=np.where(is_open, 1, 2).astype(np.uint8),
        )
    )
    minute = np.arange(days * DAY_MINUTES)
    midnight = minute // DAY_MINUTES * DAY_MINUTES
    return evidence, MONDAY_NS + (2 * minute + 1) * (MINUTE_NS // 2), (
        MONDAY_NS + midnight * MINUTE_NS)  # fmt: skip


def _changes(days: int) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Return (open, for so many minutes): a door that is used on working days, from 8 to 18."""
    rng = np.random.default_rng(days)
    is_open = np.zeros(days * DAY_MINUTES, np.uint8)
    for day in range(days):
        uses = 15 if day % 7 < 5 else 1
        for first in (day * DAY_MINUTES + rng.integers(8 * 60, 18 * 60, uses)).tolist():
            is_open[first : first + int(rng.exponential(20)) + 1] = 1
    edges = [0, *(np.flatnonzero(np.diff(is_open)) + 1).tolist(), len(is_open)]
    spans = np.array([end - start for start, end in pairwise(edges)], np.int64)
    return is_open[edges[:-1]], spans
