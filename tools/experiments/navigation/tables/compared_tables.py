"""Setups beside each other: paired differences, how many times the worst one, what each costs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from statistics import fmean

from navigation.tables.figures import RunFigures
from navigation.tables.grouped import has_map, title_of
from navigation.tables.measures import Row, RunsOf, difference, pairs_of, put, times_of
from navigation.tables.statistics import mean_of
from navigation.tables.table import Column, Table

COMPARED = (
    ("no_map", "map"), ("no_map_star", "no_map"), ("no_map_star", "map"),
    ("no_map_star", "map_star"), ("map_star", "map"), ("smart", "map"), ("smart", "map_star"),
    ("belief", "map_star"), ("belief", "smart"), ("nearest_first", "belief"), ("patrol", "belief"),
    ("patrol", "nearest_first"),
)  # fmt: skip
"""Setups that ask a question beside each other: what does the second one lack or have?"""
WORST = "no_map_star"

DIFFERENCES = (
    Column("what", "first - second"), Column("pairs", "pairs", "d"),
    Column("points", "% a run, points", "+.2f", interval=True),
    Column("average_s", "average sec", "+.1f", interval=True),
    Column("total_s", "total sec", "+,.0f", interval=True),
    Column("clear", "share differs"),
)  # fmt: skip
TIMES = (
    Column("what", "times"), Column("times", "times", ",.1f"), Column("low", "from", ",.1f"),
    Column("high", "to", ",.1f"), Column("at_least_3", "at least 3"),
)  # fmt: skip
COSTS = (
    Column("setup"), Column("in_vain_min", "driven in vain, min a run", ".1f", interval=True),
    Column("on_the_spot_percent", "of these goals without a step, %", ".0f"),
    Column("path_km", "driven, km a run", ".2f", interval=True),
    Column("metres_a_goal", "m a goal reached", ".1f", interval=True),
    Column("wrong_percent", "doors wrong in the map, %", ".1f", interval=True),
    Column("told", "sightings a run", ",.0f", interval=True),
    Column("goals_reached", "goals reached", ".1f"),
)  # fmt: skip
ON_THE_SPOT = (
    "Without a step: the robot stood before the shut door already, tried, and gave up after 20 s; "
    "the thesis tells by the time alone and counts it as after driving."
)


def differences(of: RunsOf, building: str, series: str) -> Table:
    """Return how setups differ over runs with the same goals and doors."""
    return Table(
        "differences",
        f"PAIRED DIFFERENCES, {building}, {series}: same goals, same doors",
        DIFFERENCES,
        list(_differences(of)),
        {"building": building, "series": series},
        "Of each run's own share; ±: 95 % interval over seeds.",
    )


def times(of: RunsOf, building: str, series: str) -> Table:
    """Return how many times the share of each other setup that of the worst one is."""
    return Table(
        "times",
        f"{title_of(WORST)} AGAINST THE OTHERS, {building}, {series}",
        TIMES,
        list(_times(of, paired=series == "fixed")),
        {"building": building, "series": series},
        "Ratio of % of total, all runs together; 95 % interval over seeds drawn anew.",
    )


def costs(of: RunsOf, building: str, series: str) -> Table:
    """Return what a run of each setup costs, and what its map knew."""
    rows = [_costs(setup, found) for setup, found in of.items()]
    about: Row = {"building": building, "series": series}
    title = f"WHAT IT COSTS, {building}, {series}"
    return Table("costs", title, COSTS, rows, about, ON_THE_SPOT)


def _differences(of: RunsOf) -> Iterator[Row]:
    for first, second in COMPARED:
        pairs = pairs_of(of.get(first, ()), of.get(second, ()))
        if not pairs:
            continue
        row: Row = {"what": f"{title_of(first)} - {title_of(second)}", "pairs": len(pairs)}
        points = difference(pairs, lambda run: 100 * run.share)
        put(row, "points", points)
        put(row, "average_s", difference(pairs, lambda run: run.average_s))
        put(row, "total_s", difference(pairs, lambda run: run.total_s))
        row["clear"] = "-" if math.isnan(points.half) else "yes" if points.is_clear else "no"
        yield row


def _times(of: RunsOf, *, paired: bool) -> Iterator[Row]:
    for setup, others in of.items():
        if setup == WORST:
            continue
        ratio = times_of(of[WORST], others, paired=paired)
        at_least = "-" if math.isnan(ratio.low) else "yes" if ratio.low >= 3 else "no"
        yield {"what": f"{title_of(WORST)} / {title_of(setup)}", "times": ratio.value,
               "low": ratio.low, "high": ratio.high, "at_least_3": at_least}  # fmt: skip


def _costs(setup: str, found: Sequence[RunFigures]) -> Row:
    row: Row = {"setup": title_of(setup), "goals_reached": fmean(run.reached for run in found)}
    put(row, "in_vain_min", mean_of([run.in_vain_s / 60 for run in found]))
    if in_vain := sum(run.after_driving for run in found):
        row["on_the_spot_percent"] = 100 * sum(run.on_the_spot for run in found) / in_vain
    put(row, "path_km", mean_of([run.path_m / 1000 for run in found]))
    put(row, "metres_a_goal", mean_of([run.path_m / max(1, run.reached) for run in found]))
    if has_map(setup):
        put(row, "wrong_percent", mean_of([100 * run.wrong for run in found]))
        put(row, "told", mean_of([run.told for run in found]))
    return row
