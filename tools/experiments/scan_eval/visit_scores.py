"""Figures of visits whose truth is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semmap_log.analysis.scans.visit import Visit

STATES = ("OPEN", "UNKNOWN", "CLOSED")
BINS = 10
MANY = 30
"""A bin with fewer visits is not judged."""

Counts = dict[str, int]


@dataclass(frozen=True, slots=True)
class Judged:
    """A visit and how the door really stood: open, ajar or closed."""

    visit: Visit
    truth: str


@dataclass(frozen=True, slots=True)
class Bin:
    """Visits of which much the same was said."""

    visits: int
    said: float
    """P(open) on average."""
    was: float
    """The share of them that were open."""


def counts(visits: Sequence[Judged], truth: str) -> Counts:
    """Return how many visits to doors of a truth were read as what."""
    read = [j.visit.state.name for j in visits if j.truth == truth]
    return {state: read.count(state) for state in STATES}


def plain_counts(visits: Sequence[Judged], truth: str) -> Counts:
    """Return the same by the plain rule: open if more than half of the beams went through.

    Beams that ended well before the line are left out, as there is nothing behind them to see.
    """
    read = [plain_word(j.visit) for j in visits if j.truth == truth]
    return {state: read.count(state) for state in STATES}


def plain_word(visit: Visit) -> str:
    """Return what the plain rule says of a visit; UNKNOWN: no beam came as far as the line."""
    if visit.through + visit.stopped == 0:
        return "UNKNOWN"
    return "OPEN" if visit.through > visit.stopped else "CLOSED"


def wrong_share(visits: Sequence[Judged]) -> float:
    """Return which share of the decided visits to open and closed doors is wrong; NaN: none is."""
    decided = [j for j in _plain_truths(visits) if j.visit.state.name != "UNKNOWN"]
    wrong = sum(j.visit.state.name != j.truth.upper() for j in decided)
    return wrong / len(decided) if decided else float("nan")


def undecided_share(visits: Sequence[Judged]) -> float:
    """Return which share of the visits to open and closed doors is undecided."""
    chosen = _plain_truths(visits)
    undecided = sum(j.visit.state.name == "UNKNOWN" for j in chosen)
    return undecided / len(chosen) if chosen else float("nan")


def said_accuracy(visits: Sequence[Judged]) -> float:
    """Return the accuracy that decided visits to open and closed doors claim, on average."""
    said = [j.visit.accuracy for j in _plain_truths(visits) if j.visit.state.name != "UNKNOWN"]
    return float(np.mean(said)) if said else float("nan")


def bins(visits: Sequence[Judged]) -> list[Bin]:
    """Return visits to open and closed doors, decided or not, by P(open); empty bins left out."""
    chosen = _plain_truths(visits)
    said = np.array([j.visit.p_open for j in chosen])
    was = np.array([j.truth == "open" for j in chosen], float)
    which = np.minimum((said * BINS).astype(int), BINS - 1)
    found = [(said[which == k], was[which == k]) for k in np.unique(which)]
    return [Bin(len(s), float(s.mean()), float(w.mean())) for s, w in found]


def ece(visits: Sequence[Judged]) -> float:
    """Return how far P(open) is from the share that was open, over the bins; NaN: no visits."""
    found = bins(visits)
    count = sum(b.visits for b in found)
    return sum(b.visits * abs(b.said - b.was) for b in found) / count if count else float("nan")


def worst_bin(visits: Sequence[Judged]) -> float:
    """Return how far the worst bin of `MANY` visits or more is off; 0 where there is none."""
    return max((abs(b.said - b.was) for b in bins(visits) if b.visits >= MANY), default=0.0)


def _plain_truths(visits: Sequence[Judged]) -> list[Judged]:
    return [j for j in visits if j.truth in {"open", "closed"}]
