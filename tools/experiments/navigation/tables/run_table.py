"""A row for each run, for programs: what all other tables are made of."""

from __future__ import annotations

import json

from navigation.tables.figures import RunFigures
from navigation.tables.grouped import GroupedRuns
from navigation.tables.measures import Row
from navigation.tables.table import Column, Table

NAMES = (
    "total_s", "for_goals_s", "average_s", "fastest_s", "slowest_s", "tried", "reached",
    "unreachable", "after_driving", "share", "in_vain_s", "path_m", "wrong", "told",
)  # fmt: skip


def run_table(runs: GroupedRuns) -> Table:
    """Return the records of each run that E.1 lists, and ours."""
    columns = [Column(name) for name in ("building", "setup", "series", "seed", *NAMES, "options")]
    return Table("runs", "RUNS", columns, [_row(run) for run in runs.all])


def _row(run: RunFigures) -> Row:
    key = run.key
    return {
        "building": run.building, "setup": key.setup, "series": key.series, "seed": key.seed,
        **{name: getattr(run, name) for name in NAMES},
        "options": json.dumps(run.options, sort_keys=True),
    }  # fmt: skip
