"""RUNTIMES and NUMBER OF GOALS, with the thesis's columns and rows, beside its own figures."""

from __future__ import annotations

from navigation.tables.grouped import title_of
from navigation.tables.measures import Row, RunsOf, a_run_of, percent_of, put
from navigation.tables.statistics import mean_of
from navigation.tables.table import Column, Table, runs_said
from navigation.tables.thesis import RUNS, THESIS, ThesisRow

RUNTIMES = (
    Column("setup", once=True), Column("source"), Column("runs", is_drawn=False),
    Column("total_s", "sec", ",.0f", interval=True, group="Total"),
    Column("total_h", "h", ".1f", group="Total"),
    Column("for_goals_s", "sec", ",.0f", interval=True, group="for Goals"),
    Column("for_goals_h", "h", ".1f", group="for Goals"),
    Column("average_s", "sec", ".0f", interval=True, group="Average"),
    Column("average_percent", "%", ".2f", group="Average"),
    Column("fastest_s", "sec", ".0f", group="Fastest"),
    Column("fastest_percent", "%", ".2f", group="Fastest"),
    Column("slowest_s", "sec", ",.0f", interval=True, group="Slowest"),
    Column("slowest_percent", "%", ".2f", group="Slowest"),
)  # fmt: skip
GOALS = (
    Column("setup", once=True), Column("source"), Column("runs", is_drawn=False),
    Column("tried", "# goals tried", ",.0f", interval=True),
    Column("unreachable", "# unreachable", ",.0f", interval=True),
    Column("after_driving", "# after driving", ".1f", interval=True),
    Column("percent", "% of total", ".2f", interval=True),
    Column("percent_a_run", "% a run", ".2f", interval=True),
)  # fmt: skip
HOW = (
    "% of total: all runs together; ±: 95 % interval over seeds (none at all: up to 3 / n). "
    "% a run: mean of each run's own share."
)


def runtimes(of: RunsOf, building: str, series: str) -> Table:
    """Return the thesis's table RUNTIMES of a building and series."""
    rows: list[Row] = []
    for setup, found in of.items():
        row: Row = {"setup": title_of(setup), "source": runs_said(len(found)), "runs": len(found)}
        for name in ("total", "for_goals", "average", "fastest", "slowest"):
            seconds = [float(getattr(run, f"{name}_s")) for run in found]
            put(row, f"{name}_s", mean_of(seconds))
            shares = [100 * s / run.total_s for s, run in zip(seconds, found, strict=True)]
            row[f"{name}_percent"] = mean_of(shares).value
            row[f"{name}_h"] = mean_of(seconds).value / 3600
        rows.append(row)
        if told := THESIS.get(series, {}).get(setup):
            rows.append(_of_thesis(told, setup, series))
    note = "Ours: mean of a run; %: of the run's total. ±: 95 % interval over seeds."
    if RUNS.get(series, 1) > 1:
        note += f" The thesis adds up {RUNS[series]} runs: halve its totals to compare them."
    about: Row = {"building": building, "series": series}
    return Table("runtimes", f"RUNTIMES, {building}, {series}", RUNTIMES, rows, about, note)


def goals(of: RunsOf, building: str, series: str) -> Table:
    """Return the thesis's table NUMBER OF GOALS of a building and series."""
    rows: list[Row] = []
    for setup, found in of.items():
        row: Row = {"setup": title_of(setup), "source": runs_said(len(found)), "runs": len(found)}
        for name in ("tried", "unreachable", "after_driving"):
            put(row, name, mean_of([getattr(run, name) for run in found]))
        put(row, "percent", percent_of(found))
        put(row, "percent_a_run", a_run_of(found))
        rows.append(row)
        if told := THESIS.get(series, {}).get(setup):
            rows.append({
                **_source(setup, series), "tried": told.tried, "after_driving": told.after_driving,
                "percent": told.percent,
            })  # fmt: skip
    about: Row = {"building": building, "series": series}
    title = f"NUMBER OF GOALS, {building}, {series}"
    return Table("goals", title, GOALS, rows, about, f"Ours: mean of a run. {HOW}")


def _of_thesis(told: ThesisRow, setup: str, series: str) -> Row:
    return {
        **_source(setup, series),
        "total_s": told.total_s, "total_h": told.total_s / 3600,
        "for_goals_s": told.for_goals_s, "for_goals_h": told.for_goals_s / 3600,
        "average_s": told.average_s, "average_percent": told.average_percent,
        "fastest_s": told.fastest_s, "fastest_percent": told.fastest_percent,
        "slowest_s": told.slowest_s, "slowest_percent": told.slowest_percent,
    }  # fmt: skip


def _source(setup: str, series: str) -> Row:
    source = f"thesis, {runs_said(RUNS[series])}"
    return {"setup": title_of(setup), "source": source, "runs": RUNS[series]}
