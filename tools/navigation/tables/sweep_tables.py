"""One option after the other: how the shares change with it."""

from __future__ import annotations

import json
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
    values = runs.swept[building][option]
    rows: list[Row] = []
    drawn: dict[str, Column] = {}
    for value in sorted(values, key=by_value):
        counts: set[int] = set()
        row: Row = {"value": _said(value), "usual": "usual" if value == values[0] else ""}
        for setup in runs.setups(building, series):
            if found := runs.of(building, series, setup, but=(option, value)):
                drawn[setup] = Column(setup, title_of(setup), ".2f", interval=True)
                put(row, setup, percent_of(found))
                counts.add(len(found))
        if counts:
            rows.append(row | {"runs": f"{min(counts)}"})
    if len(rows) < 2:
        return None
    setups = [drawn[setup] for setup in runs.setups(building, series) if setup in drawn]
    columns = [Column("value", option), Column("usual"), Column("runs", "runs"), *setups]
    about: Row = {"building": building, "series": series, "option": option}
    title = f"SWEEP OF {option}, {building}, {series}: % of goals tried, unreachable after driving"
    return Table("sweep", title, columns, rows, about, "runs: of each setup, at least.")


def _said(value: str) -> str:
    told = json.loads(value)
    return told if isinstance(told, str) else value
