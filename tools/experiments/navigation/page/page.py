"""The page: what the runs mean, the thesis's tables and figures, ours, and how they were made."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

from navigation.page.charts import share_chart, sweep_chart
from navigation.page.drawing import svg_of
from navigation.page.histograms import histogram
from navigation.page.html_table import html_table
from navigation.page.plan_picture import plan_picture
from navigation.runs import read_run
from navigation.setups import SETUPS
from navigation.tables.experiment import tables_of
from navigation.tables.figures import RunFigures
from navigation.tables.grouped import GroupedRuns, title_of
from navigation.tables.measures import RunsOf
from navigation.tables.table import Table
from navigation.tables.thesis import THESIS
from navigation.tables.words import options_said, words_of

FIRST = ("goals", "runtimes")
"""The thesis's own tables; the others are folded away behind them."""
ON_PLAN = ("no_map_star", "map_star")
"""Setups whose run is drawn on the plan."""
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
ABOUT = (
    "A robot is sent to random places of a building in which doors open and close, until it has "
    "reached so many of them. What the planner knows of the doors is the setup: obstacles seen by "
    "the laser (none with a star *), and a map of doors that a sensor keeps up to date. A goal "
    "that is given up within 20 seconds was planned as unreachable; one given up later counts as "
    "unreachable after driving: the robot went there in vain, or already stood before the shut "
    "door and tried."
)
SOURCE = (
    'The thesis: "A Semantic Map Implementation for a Long-Term Autonomous Robot", TU Graz, '
    "appendix E: one run a setup in the fixed series, two in the random one, without intervals."
)


def page_of(runs: GroupedRuns) -> str:
    """Return the page: one file that needs nothing else."""
    tables = tables_of(runs)
    style = Path(__file__).with_name("page.css").read_text(encoding="utf-8")
    title = "Does a map of doors help a robot to reach its goals?"
    parts = [_building(runs, tables, building) for building in runs.buildings]
    parts += [_sweeps(runs, tables), _how(runs)]
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        f"<title>{title}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n"
        f'<h1>{title}</h1>\n<p class="lead">{_counted(runs)}</p>\n<p>{escape(_about(runs))}</p>\n'
        f'{"".join(parts)}<p class="note">{escape(SOURCE)}</p>\n</main>\n</body>\n</html>\n'
    )


def _about(runs: GroupedRuns) -> str:
    """Return what was done, and what sets those setups apart that the thesis does not have."""
    made = {run.key.setup for run in runs.all}
    ours = (setup for name, setup in SETUPS.items() if name in made and setup.beyond)
    return " ".join([ABOUT, *(f"{setup.title}: {setup.beyond}." for setup in ours)])


def _building(runs: GroupedRuns, tables: list[Table], building: str) -> str:
    said = "".join(f"<li>{escape(words)}</li>\n" for words in words_of(runs, building))
    name = escape(building)
    body = [f"<h2>{name}</h2>\n<ul>\n{said}</ul>\n"]
    for series in runs.series(building):
        of = runs.by_setup(building, series)
        if not of:
            continue
        body.append(f"<h3>Goals driven to in vain, {series} series</h3>\n")
        label = f"Bars of the share of goals unreachable after driving, {building}, {series}"
        chart = _figure(share_chart(of, series), label)
        body.append(f'<div class="pictures">{chart}</div>\n')
        here = [t for t in tables if (t.about.get("building"), t.about.get("series"))
                == (building, series) and t.name != "sweep"]  # fmt: skip
        body += [html_table(table) for table in here if table.name in FIRST]
        rest = "".join(html_table(table) for table in here if table.name not in FIRST)
        body.append(f"<details><summary>Differences, and what it costs</summary>{rest}</details>\n")
    body += _pictures(runs, building)
    return f'<section id="{name}">\n{"".join(body)}</section>\n'


def _pictures(runs: GroupedRuns, building: str) -> Iterator[str]:
    series = runs.series(building)[0]
    of = runs.by_setup(building, series)
    drawn = [
        _figure(figure, f"Histogram of the times to reach a goal, {title_of(setup)}, {building}")
        for setup, found in of.items()
        if (figure := histogram(setup, found)) is not None
    ]
    yield (
        f"<h3>Times to reach a goal, {series} series</h3>\n"
        '<p class="note">As figures E.1 to E.4 of the thesis: 50 bins; dashed red: the normal '
        "distribution of the same mean and deviation.</p>\n"
        f'<div class="pictures">{"".join(drawn)}</div>\n'
    )
    plans = [
        _figure(figure, f"A run on the floor plan, {title_of(setup)}, {building}")
        for setup, run in _on_plan(of)
        if (figure := plan_picture(read_run(run.folder))) is not None
    ]
    if plans:
        first = next(setup for setup in ON_PLAN if setup in of)
        yield (
            "<h3>One run on the plan</h3>\n"
            f'<p class="note">The seed with the median share of {title_of(first)}. Blue: where the '
            "robot went. Red crosses: where it was when a goal was given up after driving. Black "
            "strokes: doors.</p>\n"
            f'<div class="pictures">{"".join(plans)}</div>\n'
        )


def _on_plan(of: RunsOf) -> Iterator[tuple[str, RunFigures]]:
    """Yield a run of each setup that is drawn, of one seed: that of the middling share."""
    setups = [setup for setup in ON_PLAN if setup in of]
    if setups:
        ranked = sorted(of[setups[0]], key=lambda run: (run.share, run.key.seed))
        seed = ranked[len(ranked) // 2].key.seed
        yield from ((s, run) for s in setups for run in of[s] if run.key.seed == seed)


def _sweeps(runs: GroupedRuns, tables: list[Table]) -> str:
    swept = [table for table in tables if table.name == "sweep"]
    if not swept:
        return ""
    body = []
    for table in swept:
        building, series, option = (str(table.about[k]) for k in ("building", "series", "option"))
        figure = sweep_chart(runs, building, series, option)
        drawn = "" if figure is None else _figure(figure, table.title)
        body.append(f'{html_table(table)}<div class="pictures">{drawn}</div>\n')
    return (
        f'<section id="sweeps">\n<h2>One option after the other</h2>\n{"".join(body)}</section>\n'
    )


def _how(runs: GroupedRuns) -> str:
    options = "".join(
        f"<p>{escape(building)}: {escape(options_said(runs, building))}.</p>\n"
        for building in runs.buildings
    )
    return (
        '<section id="how">\n<h2>How it was made</h2>\n'
        "<p>Each run is two logs of semmap-log: how the doors were, and what the robot believed "
        "and did. All on this page is made by replaying them:</p>\n"
        "<p><code>python tools/experiments/navigation_experiment.py page RUNS "
        "--to experiment.html</code></p>\n"
        f"{options}</section>\n"
    )


def _counted(runs: GroupedRuns) -> str:
    setups = {run.key.setup for run in runs.all}
    goals = sum(run.tried for run in runs.all)
    driven_km = sum(run.path_m for run in runs.all if run.path_m == run.path_m) / 1000
    thesis = len(setups & set(THESIS["fixed"]))
    return (
        f"{len(runs.all):,} runs of {len(setups)} setups, {thesis} of them the thesis's, in "
        f"{', '.join(map(escape, runs.buildings))}: {goals:,} goals tried, "
        f"{driven_km:,.0f} km driven."
    )


def _figure(figure: Any, label: str) -> str:
    return f"<figure>{svg_of(figure, label)}</figure>"
