"""All tables of the experiment: the thesis's own two (E.2), and what they leave open."""

from __future__ import annotations

from collections.abc import Iterator

from navigation.tables.compared_tables import WORST, costs, differences, times
from navigation.tables.grouped import GroupedRuns
from navigation.tables.sweep_tables import sweeps
from navigation.tables.table import Table
from navigation.tables.thesis_tables import goals, runtimes


def tables_of(runs: GroupedRuns) -> list[Table]:
    """Return all tables: by building and series, then the sweeps."""
    return [*_plain_tables(runs), *sweeps(runs)]


def _plain_tables(runs: GroupedRuns) -> Iterator[Table]:
    for building in runs.buildings:
        for series in runs.series(building):
            of = runs.by_setup(building, series)
            if not of:
                continue
            yield runtimes(of, building, series)
            yield goals(of, building, series)
            if series == "fixed":
                yield differences(of, building, series)
            if WORST in of and len(of) > 1:
                yield times(of, building, series)
            yield costs(of, building, series)
