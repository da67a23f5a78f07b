"""How often a sensor errs, where no door can feign it: between neighbours, in repeats, passing.

A share is unlikely by Chernoff's bound, P <= exp(-n KL(seen || declared)), which needs no table.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.beta import beta_interval
from semmap_log.analysis.probabilities.evidence.visits import LEAST_ACCURACY, Rows
from semmap_log.analysis.probabilities.sensors.sensor_visits import SensorVisits, Triples
from semmap_log.core.batches.event_batch import distinct, placed
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.moments import SECOND_NS

Reals = NDArray[np.float64]

BEYOND_DOUBT = 6.9
"""Nats: under what is declared the evidence is as unlikely as exp(-6.9) = 1e-3, at most."""
ALSO_WITHOUT_ONE = 3.0
"""And so unlikely, 0.05, without the door of the strongest evidence."""
QUIET_SHARE = 0.1
"""And it errs in the quietest third of the hours, too: so much of what it errs in all of them."""
FEWEST = 30
"""A door with fewer occasions does not count."""
LEAST_EFFECT = 0.02
"""A smaller difference of accuracies is not reported."""
NEAR_PASSAGE_NS = 3 * SECOND_NS
"""A reading so near to a passage saw the door that the robot went through."""
WHOLE_VISITS = 5.0
"""So many occasions count as if a visit's readings erred all together, before any is seen."""


class Seen(NamedTuple):
    """How often a sensor was right while a door was in a state, as far as that is known."""

    accuracy: float
    low: float
    """Of the 90 % interval."""
    high: float
    how: str
    """`neighbours`, `repeats`, `passages`; "": nothing contradicts what is declared."""


def by_neighbours(visits: SensorVisits, right: float, *, is_open: bool) -> Seen | None:
    """Return how a sensor reads between two visits that agree, if that is better than declared."""
    said = visits.share if is_open else 1 - visits.share
    odd, doors = 1 - said[1:-1], visits.door_id
    alone = (said[:-2] > 0.5) & (said[2:] > 0.5) & (doors[:-2] == doors[2:])
    odd, of_door = odd[alone], doors[1:-1][alone]
    # Occasions overlap: two in a row lean on each other's readings, 1 + 2 q (1 - q) of a binomial.
    overlap = 1 + 2 * right * (1 - right)
    parts = [odd, *(odd[of_door == door] for door in distinct(of_door))]
    for index, part in enumerate(parts):
        if len(part) < FEWEST:
            continue
        share, count = float(part.mean()), len(part) / _together(part) / overlap
        wanted = BEYOND_DOUBT + (np.log(len(parts) - 1) if index else 0.0)
        if share < 1 - right - LEAST_EFFECT and count * _divergence(share, 1 - right) > wanted:
            return _seen(count * (1 - share), count * share, "neighbours")
    return None


def by_repeats(triples: Triples, right: float, other: float) -> Seen | None:
    """Return how often a sensor differs from itself, if that is more often than declared."""
    triples = triples.only(triples.usable)
    if len(distinct(triples.door_id)) < 2:  # one door may flicker
        return None
    counts, odd = triples.both, triples.odd
    mixed = _mixed(counts, triples.others, right, other)
    # A door that moves: more readings differ at the edge of three than in the middle.
    moves = np.maximum(triples.edge / 2 - odd, 0) / counts
    feigned = mixed * other + 2 * moves**2
    expected = (1 - mixed) * (1 - right) + feigned
    share = odd / counts
    quieter = np.argsort(share / expected, kind="stable")
    third = quieter[np.cumsum(counts[quieter]) <= counts.sum() / 3]
    excess = odd - counts * expected
    if excess[third].sum() <= counts[third].sum() / counts.sum() * QUIET_SHARE * excess.sum():
        return None
    surprise = np.where(share > expected, counts * _divergence(share, expected), 0.0)
    door = placed(triples.door_id)[1]
    rest = door != np.argmax(np.bincount(door, surprise))
    for chosen, wanted in ((rest | True, BEYOND_DOUBT), (rest, ALSO_WITHOUT_ONE)):
        weight = counts[chosen] / counts[chosen].sum()
        pooled = float(weight @ share[chosen]), float(weight @ expected[chosen])
        if pooled[0] <= pooled[1] or counts[chosen].sum() * _divergence(*pooled) < wanted:
            return None
    errs = float(np.maximum((odd - counts * feigned).sum(), 0))
    while_here = float((counts * (1 - mixed)).sum())
    if errs / while_here < 1 - right + LEAST_EFFECT:
        return None
    return _seen(while_here - errs, errs, "repeats")


def _mixed(both: NDArray[np.int64], others: NDArray[np.int64], right: float, other: float) -> Reals:
    """Return (doors,): how many of the pairs that agree on a state are two errors in the other."""
    total = both + others
    p = np.divide(both, total, out=np.zeros(len(both)), where=total > 0)
    # p = (s a^2 + (1 - s) (1 - b)^2) / (s (a^2 + (1 - a)^2) + (1 - s) (b^2 + (1 - b)^2)), for s.
    agree_here, agree_other = right**2 + (1 - right) ** 2, other**2 + (1 - other) ** 2
    above = p * agree_other - (1 - other) ** 2
    below = right**2 - (1 - other) ** 2 - p * (agree_here - agree_other)
    s = np.clip(above / below, 0.0, 1.0)
    wrong = (1 - s) * (1 - other) ** 2
    found: Reals = wrong / np.maximum(s * right**2 + wrong, 1e-12)
    return found


def by_passages(rows: Rows, passages: Rows, right: float) -> Seen | None:
    """Return what a sensor read while a robot went through, if it erred more than declared."""
    errs = np.concatenate([np.empty(0), *_near(rows, passages)])
    if len(errs) < FEWEST:
        return None
    share, count = float(errs.mean()), len(errs) / _together(errs)
    if share < 1 - right + LEAST_EFFECT or count * _divergence(share, 1 - right) < BEYOND_DOUBT:
        return None
    return _seen(count * (1 - share), count * share, "passages")


def _near(rows: Rows, passages: Rows) -> Iterator[Reals]:
    """Yield, door by door, the share of readings near each passage that say closed."""
    for door_id in distinct(passages["door_id"]):
        own = rows[rows["door_id"] == door_id]
        at_ns = passages["folds_ns"][passages["door_id"] == door_id]
        closed = np.append(0, np.cumsum(own["state"] == DoorState.CLOSED))
        first = np.searchsorted(own["folds_ns"], at_ns - NEAR_PASSAGE_NS, "left")
        last = np.searchsorted(own["folds_ns"], at_ns + NEAR_PASSAGE_NS, "right")
        seen = last > first
        yield (closed[last[seen]] - closed[first[seen]]) / (last[seen] - first[seen])


def _together(errs: Reals) -> float:
    """Return how far the readings of a visit err together: 1 is wholly, 1 / n of n is not at all.

    Of rare errors it is E[share^2] / E[share].
    """
    return float((np.square(errs).sum() + WHOLE_VISITS) / (errs.sum() + WHOLE_VISITS))


def _divergence(seen: Reals | float, declared: Reals | float) -> Reals:
    """Return KL(seen || declared) of two shares, in nats."""
    p, q = np.asarray(seen, np.float64), np.clip(declared, 1e-9, 1 - 1e-9)
    with np.errstate(divide="ignore", invalid="ignore"):
        one = np.where(p > 0, p * np.log(p / q), 0.0)
        two = np.where(p < 1, (1 - p) * np.log((1 - p) / (1 - q)), 0.0)
    found: Reals = one + two
    return found


def _seen(hits: float, misses: float, how: str) -> Seen:
    accuracy = max(LEAST_ACCURACY, hits / (hits + misses))
    low, high = beta_interval(hits + 0.5, misses + 0.5)
    return Seen(accuracy, max(LEAST_ACCURACY, low), max(LEAST_ACCURACY, high), how)
