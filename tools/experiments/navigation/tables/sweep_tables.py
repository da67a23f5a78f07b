"""One option after the other: how the shares change with it."""

from __future__ import annotations

from collections.abc import Iterator

from navigation.tables.grouped import GroupedRuns, by_value, title_of, value_said
from navigation.tables.measures import Row, percent_of, put
from navigation.tables.table import Column, Table

NOTES = {
    "fixed": "The usual value stands beside each other one, over the same seeds. "
    "runs: of each setup, at least."
}


def sweeps(runs: GroupedRuns) -> Iterator[Table]:
    """Yield a table for each option that was swept, by building and series."""
    for building in runs.buildings:
        for series in runs.series(building):
            for option in runs.swept[building]:
                if table := _sweep(runs, building, series, option):
                    yield table


def _sweep(runs: GroupedRuns, building: str, series: str, option: str) -> Table | None:
    """Return a table with two rows for each value: its own, and that of the usual one."""
    usual, *others = runs.swept[building][option]
    rows: list[Row] = []
    drawn: dict[str, Column] = {}
    for value in sorted(others, key=by_value):
        own: Row = {"value": value_said(value), "beside": ""}
        same: Row = {"value": value_said(usual), "beside": value_said(value)}
        counts = set()
        for setup in runs.setups(building, series):
            found = runs.beside_usual(building, series, setup, (option, value))
            if all(found):
                drawn[setup] = Column(setup, title_of(setup), ".2f", interval=True)
                counts.add(len(found[0]))
                for row, some in zip((own, same), found, strict=True):
                    put(row, setup, percent_of(some))
        if counts:
            rows += [row | {"runs": f"{min(counts)}"} for row in (own, same)]
    if not rows:
        return None
    setups = [drawn[setup] for setup in runs.setups(building, series) if setup in drawn]
    columns = [Column("value", option), Column("beside", "beside"), Column("runs", "runs"), *setups]
    about: Row = {"building": building, "series": series, "option": option}
    title = f"SWEEP OF {option}, {building}, {series}: % of goals tried, unreachable after driving"
    return Table("sweep", title, columns, rows, about, NOTES.get(series, ""))
