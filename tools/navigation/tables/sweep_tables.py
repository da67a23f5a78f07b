"""One option after the other: how the shares change with it."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator

from navigation.tables.grouped import GroupedRuns, by_value, title_of
from navigation.tables.measures import Row, percent_of, put
from navigation.tables.table import Column, Table


def sweeps(runs: GroupedRuns) -> Iterator[Table]:
    """Yield a table for each option that was swept, by building and series."""
    for building in runs.buildings:
        for series in runs.series(building):
            for option in runs.swept[building]:
                if table := _sweep(runs, building, series, option):
                    yield table


def _sweep(runs: GroupedRuns, building: str, series: str, option: str) -> Table | None:
    """Return the table of the setups that have runs at two values or more; None: there is none."""
    values = runs.swept[building][option]
    found = {
        (setup, value): some
        for setup in runs.setups(building, series)
        for value in values
        if (some := runs.of(building, series, setup, but=(option, value)))
    }
    counts = Counter(setup for setup, _ in found)
    setups = [setup for setup, count in counts.items() if count > 1]
    if not setups:
        return None
    rows: list[Row] = []
    for value in sorted(values, key=by_value):
        here = {setup: found[setup, value] for setup in setups if (setup, value) in found}
        row: Row = {"value": _said(value), "usual": "usual" if value == values[0] else ""}
        for setup, some in here.items():
            put(row, setup, percent_of(some))
        if here:
            rows.append(row | {"runs": f"{min(map(len, here.values()))}"})
    drawn = [Column(setup, title_of(setup), ".2f", interval=True) for setup in setups]
    columns = [Column("value", option), Column("usual"), Column("runs", "runs"), *drawn]
    about: Row = {"building": building, "series": series, "option": option}
    title = f"SWEEP OF {option}, {building}, {series}: % of goals tried, unreachable after driving"
    return Table("sweep", title, columns, rows, about, "runs: of each setup, at least.")


def _said(value: str) -> str:
    told = json.loads(value)
    return told if isinstance(told, str) else value
