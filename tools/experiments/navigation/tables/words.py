"""What the figures mean, in sentences that are made of them: another outcome, another sentence."""

from __future__ import annotations

import math
from collections.abc import Iterator

from navigation.tables.figures import RunFigures
from navigation.tables.grouped import GroupedRuns, title_of, value_said
from navigation.tables.measures import RunsOf, a_run_of, difference, pairs_of, percent_of, times_of
from navigation.tables.statistics import Interval, Ratio
from navigation.tables.table import runs_said
from navigation.tables.thesis import THESIS

NEAR = "near_m"
Runs = list[RunFigures]


def words_of(runs: GroupedRuns, building: str) -> list[str]:
    """Return what the runs of a building say; of series with the same goals, if there are any."""
    series = runs.series(building)[0]
    of = runs.by_setup(building, series)
    seeds = max(map(len, of.values()))
    if seeds < 2:
        return [f"{runs_said(seeds)} of a setup: nothing can be said of others like it."]
    return [
        *_of_setups(of, series),
        *_of_nearness(runs, building, series),
        *_of_options(runs, building, series),
    ]


def _of_setups(of: RunsOf, series: str) -> Iterator[str]:
    paired = series == "fixed"
    if {"no_map_star", "map_star"} <= of.keys():
        yield _without_obstacles(of["no_map_star"], of["map_star"], paired=paired)
    if {"no_map", "map"} <= of.keys():
        yield _with_obstacles(of["no_map"], of["map"])
    if {"map", "map_star"} <= of.keys():
        yield _instead_of_obstacles(of["map_star"], of["map"])
    if {"smart", "map_star"} <= of.keys():
        yield _beside_the_map("Doors that report themselves (Smart)", of["smart"], of["map_star"])
    if {"belief", "map_star"} <= of.keys():
        yield _beside_the_map("P(open) learnt as cost (Belief)", of["belief"], of["map_star"])
    if {"patrol", "nearest_first"} <= of.keys():
        yield _order(of["patrol"], of["nearest_first"])
    yield from _beside_the_thesis(of, series)


def _without_obstacles(without: Runs, with_map: Runs, *, paired: bool) -> str:
    times = times_of(without, with_map, paired=paired)
    figures = (
        f"without it {share_said(percent_of(without))} of the goals tried turned out unreachable "
        f"only after the robot had driven there, with it {share_said(percent_of(with_map))}"
    )
    where = "Where the global costmap holds no obstacles, the map of doors"
    if times.low > 1:
        return f"{where} helps: {figures}, {_times_said(times, 'less')}."
    if times.high < 1:
        return f"{where} does harm: {figures}."
    return f"{where} makes no difference that these runs can show: {figures}."


def _with_obstacles(without: Runs, with_map: Runs) -> str:
    without, with_map = _same_seeds(without, with_map)
    points = _points(without, with_map)
    shares = share_said(a_run_of(without)), share_said(a_run_of(with_map))
    both = f"in the mean of a run {shares[0]} without, {shares[1]} with it"
    begin = "Where the laser's obstacles are in the global costmap, the map of doors"
    if not points.is_clear:
        return f"{begin} makes no difference that these runs can show: {both}."
    if points.value > 0:
        return f"{begin} still helps, by {_points_said(points)}: {both}."
    return f"{begin} does harm, by {_points_said(points)}: {both}."


def _instead_of_obstacles(star: Runs, both: Runs) -> str:
    star, both = _same_seeds(star, both)
    points = _points(star, both)
    shares = (
        f"in the mean of a run {share_said(a_run_of(star))} against {share_said(a_run_of(both))}"
    )
    if not points.is_clear:
        return ("Between the map alone (Map*) and map and obstacles together (Map) these runs show "
                f"no difference: {shares}.")  # fmt: skip
    word = "worse" if points.value > 0 else "better"
    return (f"The map alone (Map*) is {word} than map and obstacles together (Map) by "
            f"{_points_said(points)}: {shares}.")  # fmt: skip


def _beside_the_map(what: str, runs: Runs, others: Runs) -> str:
    """Say what a setup is worth that differs from Map* in one thing."""
    runs, others = _same_seeds(runs, others)
    points = _points(runs, others)
    minutes = difference(pairs_of(runs, others), lambda run: run.total_s / 60)
    told = f"{share_said(a_run_of(runs))} against {share_said(a_run_of(others))}"
    if points.is_clear:
        word = "more" if points.value > 0 else "less"
        begin = f"{what}: {_points_said(points)} {word} driven in vain than with Map* ({told})"
    else:
        begin = f"{what}: no difference in goals driven to in vain from Map* ({told})"
    return f"{begin}; {_time_said(minutes)}."


def _order(patrol: Runs, nearest: Runs) -> str:
    patrol, nearest = _same_seeds(patrol, nearest)
    minutes = difference(pairs_of(patrol, nearest), lambda run: run.total_s / 60)
    return (f"With ten goals to choose from, the order of least mean time to a goal (Patrol) "
            f"against the nearest first: {_time_said(minutes)}; "
            f"{share_said(a_run_of(patrol))} and {share_said(a_run_of(nearest))} driven to in "
            "vain.")  # fmt: skip


def _beside_the_thesis(of: RunsOf, series: str) -> Iterator[str]:
    for setup in ("no_map_star", "map_star", "map"):
        told = THESIS.get(series, {}).get(setup)
        if setup not in of or told is None:
            continue
        share = percent_of(of[setup])
        beside = "holds"
        if not share.low <= told.percent <= share.high:
            beside = "lies below" if share.high < told.percent else "lies above"
        yield (
            f"{title_of(setup)}: {share_said(share)} here; the interval {beside} the thesis's "
            f"{told.percent:g} %."
        )


def _of_nearness(runs: GroupedRuns, building: str, series: str) -> Iterator[str]:
    told = []
    for value in sorted(runs.swept[building].get(NEAR, []), key=float):
        star, both = (
            runs.of(building, series, setup, but=(NEAR, value)) for setup in ("map_star", "map")
        )
        if star and both:
            times = times_of(star, both, paired=series == "fixed")
            beside = _times_said(times) if times.low > 1 else "no difference that shows"
            shares = f"{percent_of(star).value:.2f} and {percent_of(both).value:.2f} %"
            told.append(f"at {float(value):g} m {shares}, {beside}")
    if len(told) > 1:
        yield f"How near a door must be to be seen, Map* and Map: {'; '.join(told)}."


def _of_options(runs: GroupedRuns, building: str, series: str) -> Iterator[str]:
    """Yield the shares with each other value of an option that was swept."""
    for option, (usual, *others) in runs.swept[building].items():
        for value in others if option != NEAR else ():
            told = []
            for setup in runs.setups(building, series):
                found, same = runs.beside_usual(building, series, setup, (option, value))
                if len(found) > 1:
                    shares = share_said(percent_of(found)), plainly(percent_of(same).value)
                    told.append(f"{title_of(setup)} {shares[0]} for {shares[1]}")
            if told:
                values = f"{value_said(value)} in place of {value_said(usual)}"
                yield f"With {option} {values}: {', '.join(told)}."


def _same_seeds(one: Runs, other: Runs) -> tuple[Runs, Runs]:
    """Return the runs of the seeds that both have, so that shares fit their difference."""
    pairs = pairs_of(one, other)
    return [run for run, _ in pairs], [run for _, run in pairs]


def _points(one: Runs, other: Runs) -> Interval:
    return difference(pairs_of(one, other), lambda run: 100 * run.share)


def share_said(share: Interval) -> str:
    """Return a share in percent, as a sentence takes it."""
    beside = f" (±{share.half:.{_digits(share.value)}f})"
    if not share.value:
        beside = f" (at most {share.half:.2f})"
    return plainly(share.value) + ("" if math.isnan(share.half) else beside)


def plainly(percent: float) -> str:
    """Return a share without its interval."""
    return f"{percent:.{_digits(percent)}f} %"


def _digits(percent: float) -> int:
    return 1 if percent >= 10 else 2


def _points_said(points: Interval) -> str:
    return f"{abs(points.value):.2f} points (±{points.half:.2f})"


def _times_said(times: Ratio, than: str = "") -> str:
    digits = 0 if times.low >= 10 else 1
    if math.isinf(times.high):
        return " ".join([f"at least {times.low:,.{digits}f} times", *([than] if than else [])])
    ends = f"({times.low:,.{digits}f} to {times.high:,.{digits}f})"
    return " ".join([f"{times.value:,.{digits}f} times", *([than] if than else []), ends])


def _time_said(minutes: Interval) -> str:
    if math.isnan(minutes.half):
        return "its time cannot be compared"
    if not minutes.is_clear:
        told = f"{round(minutes.value, 1) + 0.0:+.1f} ±{minutes.half:.1f} min a run"
        return f"no difference in time that shows ({told})"
    word = "longer" if minutes.value > 0 else "shorter"
    return f"a run is {abs(minutes.value):.1f} min (±{minutes.half:.1f}) {word}"


def options_said(runs: GroupedRuns, building: str) -> str:
    """Return with which options the runs of a building were made, where they were not swept."""
    of = runs.by_setup(building, runs.series(building)[0])
    options = next(iter(of.values()))[0].options
    return ", ".join(f"{name} {value}" for name, value in options.items() if value is not None)
