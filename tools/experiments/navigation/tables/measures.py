"""What tables say of several runs: shares, pairs of the same seed, intervals in a row."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from navigation.tables.figures import RunFigures
from navigation.tables.statistics import Interval, Ratio, mean_of, ratio_of, share_of
from navigation.tables.table import Value

Row = dict[str, Value]
RunsOf = dict[str, list[RunFigures]]
"""The runs of each setup, of one building and series, by ascending seed."""


def percent_of(found: Sequence[RunFigures]) -> Interval:
    """Return the % of goals tried that were unreachable after driving, of all runs together."""
    share = share_of([run.after_driving for run in found], [run.tried for run in found])
    return Interval(100 * share.value, 100 * share.half)


def a_run_of(found: Sequence[RunFigures]) -> Interval:
    """Return the mean share of a run in percent; where nothing was counted, that of all goals."""
    if not any(run.after_driving for run in found):
        return percent_of(found)
    return mean_of([100 * run.share for run in found])


def pairs_of(
    one: Sequence[RunFigures], other: Sequence[RunFigures]
) -> list[tuple[RunFigures, RunFigures]]:
    """Return the runs of the same seed, side by side."""
    of_seed = {run.key.seed: run for run in other}
    return [(run, of_seed[run.key.seed]) for run in one if run.key.seed in of_seed]


def difference(
    pairs: Sequence[tuple[RunFigures, RunFigures]], what: Callable[[RunFigures], float]
) -> Interval:
    """Return how much more the first of each pair has, in the mean."""
    return mean_of([what(one) - what(other) for one, other in pairs])


def times_of(one: Sequence[RunFigures], other: Sequence[RunFigures], *, paired: bool) -> Ratio:
    """Return how many times the share of some runs is that of others.

    Args:
        one: Runs of a setup.
        other: Runs of another.
        paired: They share seeds: only seeds that both have count.
    """
    if paired:
        pairs = pairs_of(one, other)
        one, other = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    counts = ([(run.after_driving, run.tried) for run in found] for found in (one, other))
    return ratio_of(*counts, paired=paired)


def put(row: Row, name: str, interval: Interval) -> None:
    """Put a value and half of its interval into a row."""
    row[name], row[f"{name}_pm"] = interval.value, interval.half
