"""Case: what half a year of noisy visits tells of each hour, by each mode that it may be in."""

from __future__ import annotations

from functools import partial

import numpy as np

from benchmark import plain_beliefs
from benchmark.case import Case, Peer, Work
from benchmark.near import Near
from benchmark.peers import OURS, on_cores
from semmap_log.analysis.probabilities.chain import hour_modes
from semmap_log.analysis.probabilities.chain.hour_looks import HourLooks
from semmap_log.analysis.probabilities.chain.looks import Looks
from semmap_log.core.model.local_clock import LocalClock

HOUR_NS = 3600 * 10**9
CLOCK = LocalClock("UTC")
LLR = float(np.log(0.9 / 0.1))


def visits_case(count: int, rounds: int | None) -> Case:
    """Return: the likelihoods of one door's visits in all modes, hour by hour, on one core."""
    expected = Near(tuple(_explained(_visits(count))), 1e-6)
    peers = (
        Peer(on_cores(OURS, 1), partial(_ours, count), expected, cores=1, promise="< 1000 ms"),
        Peer("plain Python, visit by visit", partial(_plain, count), expected, cores=1),
    )
    title = f"What visits tell of hours, {count:,} visits"
    return Case("beliefs", title, "ms", peers, rounds or 1, warms_up=False)


def _ours(count: int) -> Work:
    visits = _visits(count)
    return Work(
        lambda _: HourLooks(visits, CLOCK).explained(None),
        answer=lambda found: tuple(found.sum(0).tolist()),
    )


def _plain(count: int) -> Work:
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
