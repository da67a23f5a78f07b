"""Case: how often a door changes, and what was believed of it, from noisy visits alone."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmark import plain_beliefs
from benchmark.case import Case, Peer, Work
from benchmark.near import Near
from benchmark.peers import OURS, on_cores
from semmap_log.probabilities.chain.markov_chain import Nodes, passage
from semmap_log.probabilities.chain.rates import learn_rates

HOUR_S, DAY_S = 3600, 86_400
OPENING, CLOSING = 1 / (6 * HOUR_S), 1 / (2 * HOUR_S)
ACCURACY = 0.9
LIKE, ROUGHLY = 0.05, 0.1
"""How near the rates of a simulated door come back: overall, and the mean of each hour's own."""
FEW = 10_000
"""From fewer visits they need not."""


def visits_case(count: int, rounds: int | None) -> Case:
    """Return: EM and filtering of one door's visits, on one core."""
    found = _rates_and_beliefs(_visits(count))
    within = (LIKE, ROUGHLY) if count > FEW else (1.0, 1.0)
    overall, by_hour = (Near((OPENING, CLOSING), part) for part in within)
    peers = (
        Peer(on_cores(OURS, 1), partial(_ours, count), overall, cores=1,
             promise="< 2000 ms"),
        Peer(f"{OURS}, rates by the hour", partial(_ours_by_hour, count), by_hour, cores=1,
             promise="< 2000 ms"),
        Peer("plain Python, the same EM", partial(_plain, count),
             Near(_of_beliefs(*found), 1e-6), cores=1),
    )  # fmt: skip
    title = f"Rates and beliefs, {count:,} visits"
    return Case("beliefs", title, "ms", peers, rounds or 1, warms_up=False)


def _ours(count: int) -> Work:
    nodes = _visits(count)
    return Work(lambda _: _rates_and_beliefs(nodes), answer=lambda found: found[:2])


def _ours_by_hour(count: int) -> Work:
    nodes = _visits(count)
    by_hour = nodes.with_bins((np.cumsum(nodes.gap_s) % DAY_S // HOUR_S).astype(np.intp))

    def once(_: None) -> Any:
        rates = learn_rates(by_hour, bins=24, prior=learn_rates(nodes))
        return rates, passage(by_hour, rates).filtered

    return Work(once, answer=lambda found: (found[0].opening.mean(), found[0].closing.mean()))


def _plain(count: int) -> Work:
    nodes = _visits(count)
    gaps_s, llrs = nodes.gap_s.tolist(), nodes.llr.tolist()
    return Work(
        lambda _: plain_beliefs.rates_and_beliefs(gaps_s, llrs),
        answer=lambda found: _of_beliefs(*found),
    )


def _rates_and_beliefs(nodes: Nodes) -> tuple[float, float, NDArray[np.float64]]:
    rates = learn_rates(nodes)
    return float(rates.opening[0]), float(rates.closing[0]), passage(nodes, rates).filtered


def _of_beliefs(opening: float, closing: float, beliefs: Any) -> tuple[float, ...]:
    """Return what two answers are compared by: the rates, and a hundred beliefs."""
    return (opening, closing, *np.asarray(beliefs)[:: max(len(beliefs) // 100, 1)].tolist())


def _visits(count: int) -> Nodes:
    """Return about half-hourly looks at a door of known rates, right nine times in ten."""
    rng = np.random.default_rng(count)
    gap_s = np.append(0.0, rng.uniform(600, 3000, count - 1))
    times_s = np.cumsum(gap_s)
    stays = rng.exponential((1 / OPENING, 1 / CLOSING), (int(times_s[-1] * OPENING) + 100, 2))
    is_open = np.searchsorted(np.cumsum(stays), times_s, "right") % 2 == 1
    reads_open = is_open == (rng.random(count) < ACCURACY)
    llr = np.log(ACCURACY / (1 - ACCURACY))
    return Nodes(gap_s, np.where(reads_open, llr, -llr), np.zeros(count, np.intp),
                 np.arange(count) == 0)  # fmt: skip
