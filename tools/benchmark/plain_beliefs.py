"""What beliefs take in plain Python: a loop for each visit, each sighting, each minute.

`rates_and_beliefs` is the EM of `chain.rates`, one visit after another, as papers write it down;
`visits` and `hour_of_week` are what somebody would write who counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

START_PER_S = 1 / (4 * 3600)
LEAST_PER_S, MOST_PER_S = 1 / (60 * 86400), 1 / 20
ENOUGH = 1e-6
MOST_ROUNDS = 100
PASS_S, REPEATS_S = 300, 60

Sighting = tuple[int, int, bool, float, float]
"""Door, when (seconds), whether it read open, and P(it reads right) of open and closed doors."""


def rates_and_beliefs(
    gaps_s: Sequence[float], llrs: Sequence[float]
) -> tuple[float, float, list[float]]:
    """Return a door's rates of opening and closing, and P(open) after each visit.

    Args:
        gaps_s: Since the visit before; the first is not looked at.
        llrs: What each visit says.
    """
    opening = closing = START_PER_S
    sees = [1 / (1 + math.exp(-llr)) for llr in llrs]
    last = -math.inf
    for _ in range(MOST_ROUNDS):
        beliefs, likelihood = _forward(gaps_s, sees, opening, closing)
        if likelihood - last <= ENOUGH * abs(likelihood):
            break
        last = likelihood
        later = _backward(gaps_s, sees, opening, closing)
        opening, closing = _better(gaps_s, sees, beliefs, later, (opening, closing))
    return opening, closing, beliefs


def _forward(
    gaps_s: Sequence[float], sees: Sequence[float], opening: float, closing: float
) -> tuple[list[float], float]:
    """Return P(open) by the visits up to each, and the log-likelihood of all."""
    relaxation = opening + closing
    long_run = opening / relaxation
    beliefs, likelihood, belief, kept = [], 0.0, 0.5, 1.0
    for i, (gap_s, see) in enumerate(zip(gaps_s, sees, strict=True)):
        if i:
            kept = math.exp(-relaxation * gap_s)
            belief = long_run + (belief - long_run) * kept
        opened, closed = belief * see, (1 - belief) * (1 - see)
        likelihood += math.log(opened + closed)
        belief = opened / (opened + closed)
        beliefs.append(belief)
    return beliefs, likelihood


def _backward(
    gaps_s: Sequence[float], sees: Sequence[float], opening: float, closing: float
) -> list[float]:
    """Return how the visits behind each weigh: for open, of open and closed together."""
    relaxation = opening + closing
    long_run = opening / relaxation
    later, weight = [0.5] * len(sees), 0.5
    for i in range(len(sees) - 2, -1, -1):
        kept = math.exp(-relaxation * gaps_s[i + 1])
        opened, closed = weight * sees[i + 1], (1 - weight) * (1 - sees[i + 1])
        either = long_run * opened + (1 - long_run) * closed
        from_open = either + kept * (1 - long_run) * (opened - closed)
        from_closed = either - kept * long_run * (opened - closed)
        weight = from_open / (from_open + from_closed)
        later[i] = weight
    return later


def _better(
    gaps_s: Sequence[float],
    sees: Sequence[float],
    beliefs: Sequence[float],
    later: Sequence[float],
    rates: tuple[float, float],
) -> tuple[float, float]:
    """Return the rates that explain what is to be expected between the visits."""
    opening, closing = rates
    relaxation = opening + closing
    shares = closing / relaxation, opening / relaxation
    openings = closings = closed_s = open_s = 0.0
    for i in range(1, len(sees)):
        gap_s = gaps_s[i]
        kept = math.exp(-relaxation * gap_s)
        once_s, both_s = (1 - kept) / relaxation, gap_s * kept
        was = 1 - beliefs[i - 1], beliefs[i - 1]
        then = (1 - later[i]) * (1 - sees[i]), later[i] * sees[i]
        moves = [[shares[b] + kept * ((a == b) - shares[b]) for b in (0, 1)] for a in (0, 1)]
        total = sum(was[a] * moves[a][b] * then[b] for a in (0, 1) for b in (0, 1))
        spans = gap_s, once_s, both_s
        for a in (0, 1):
            for b in (0, 1):
                weight = was[a] * then[b] / total
                openings += weight * opening * _time_s(shares, spans, (a, b), (0, 1))
                closings += weight * closing * _time_s(shares, spans, (a, b), (1, 0))
                closed_s += weight * _time_s(shares, spans, (a, b), (0, 0))
                open_s += weight * _time_s(shares, spans, (a, b), (1, 1))
    return _bounded(openings / closed_s), _bounded(closings / open_s)


def _time_s(
    shares: tuple[float, float],
    spans: tuple[float, float, float],
    ends: tuple[int, int],
    moves: tuple[int, int],
) -> float:
    """Return the integral over time of P(leaving | start) P(end | entered), in closed form."""
    (start, end), (leaving, entered) = ends, moves
    from_start = (start == leaving) - shares[leaving]
    to_end = (entered == end) - shares[end]
    gap_s, once_s, both_s = spans
    return (
        shares[leaving] * shares[end] * gap_s
        + (shares[leaving] * to_end + from_start * shares[end]) * once_s
        + from_start * to_end * both_s
    )


def _bounded(rate: float) -> float:
    return min(max(rate, LEAST_PER_S), MOST_PER_S)


def visits(sightings: Sequence[Sighting]) -> tuple[int, float]:
    """Return how many visits sightings make, and the sum of what these tell: their means."""
    by_door: dict[int, list[tuple[int, float]]] = {}
    for door, time_s, reads_open, right_open, right_closed in sightings:
        if reads_open:
            llr = math.log(right_open / (1 - right_closed))
        else:
            llr = math.log((1 - right_open) / right_closed)
        by_door.setdefault(door, []).append((time_s, llr))
    count, told = 0, 0.0
    for seen in by_door.values():
        for one in _passes(sorted(seen)):
            count += 1
            told += sum(one) / len(one)
    return count, told


def _passes(seen: Sequence[tuple[int, float]]) -> Iterator[list[float]]:
    begun_s, llrs = seen[0][0], [seen[0][1]]
    for (before_s, _), (time_s, llr) in pairwise(seen):
        if time_s - before_s >= REPEATS_S or time_s - begun_s > PASS_S:
            yield llrs
            begun_s, llrs = time_s, []
        llrs.append(llr)
    yield llrs


def hour_of_week(is_open: Sequence[int]) -> list[float]:
    """Return P(open) in each minute from a Monday on, as the midnight before it knew.

    A table of the hours of the week; an hour that was never seen has the share of all, and at first
    that is one half. Nothing is said for surer than a thousandth.

    Args:
        is_open: Of each minute, 0 or 1.
    """
    opened, known, said = [0] * 168, [0] * 168, []
    for first in range(0, len(is_open), 1440):
        day = is_open[first : first + 1440]
        total = sum(known)
        share = sum(opened) / total if total else 0.5
        shares = (o / k if k else share for o, k in zip(opened, known, strict=True))
        table = [min(max(p, 0.001), 0.999) for p in shares]
        hour = first // 60 % 168
        said += [table[hour + minute // 60] for minute in range(len(day))]
        for minute, state in enumerate(day):
            opened[hour + minute // 60] += state
            known[hour + minute // 60] += 1
    return said
