"""What many logs answered: as a table for people, a document for programs, a file."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semmap_log.cli.common import console, say

if TYPE_CHECKING:
    from semmap_log.fleet.jobs.job import FleetAnswer

MOST_ROWS = 40
"""Of an answer, unless it goes to a file or a program."""


def write_rows(found: FleetAnswer, out: Path) -> None:
    """Write the rows of an answer as a file; its name says whether CSV or Parquet."""
    from semmap_log.core.arrow.parquet import write_parquet
    from semmap_log.core.io.disk import atomic_file, output_errors
    from semmap_log.core.texts import counted
    from semmap_log.views.fleet_tables import write_csv

    with output_errors(out), atomic_file(out) as temporary:
        if out.suffix == ".csv":
            write_csv(temporary, found.table)
        else:
            write_parquet(temporary, [found.table], found.table.schema, {})
    say(f"{out}: {counted(found.table.num_rows, 'row')}")


def print_answer(found: FleetAnswer, out: Path | None) -> None:
    """Print an answer for people: the first rows, unless they went to a file, and what is bad."""
    from semmap_log.core.texts import counted
    from semmap_log.views.fleet_tables import arrow_rows_table, bad_logs_table, outcomes_text

    if out is None:
        console().print(arrow_rows_table(found.table.slice(0, MOST_ROWS)))
        if (more := found.table.num_rows - MOST_ROWS) > 0:
            say(f"{more:,} more rows: --out FILE.parquet, or --json, has all")
    elif "file" in found.table.column_names:
        say(f"{out}: {counted(found.table.num_rows, 'file')}")
    if found.bad:
        console().print()
        console().print(bad_logs_table(found.bad))
    say(outcomes_text(found.logs))


def answer_to_json(found: FleetAnswer) -> dict[str, Any]:
    """Return a fleet's answer as `--json` prints it; times are nanoseconds UTC."""
    from semmap_log.fleet.jobs.job import FoldAnswer
    from semmap_log.views.fleet_tables import plain_rows

    states = found.states if isinstance(found, FoldAnswer) else None
    return {
        "logs": [{"log": log.pop("place"), **log} for log in map(asdict, found.logs)],
        "rows": list(plain_rows(found.table))
        if states is None
        else [{"log": log, "state": _json_of(state)} for log, state in states.items()],
    }


def _json_of(state: Any) -> Any:
    """Return a projection's state as JSON knows it; what it does not know, as Python writes it."""
    if isinstance(state, dict):
        return {str(key): _json_of(value) for key, value in state.items()}
    if isinstance(state, list | tuple | set | frozenset):
        return [_json_of(value) for value in state]
    if hasattr(state, "tolist"):
        return _json_of(state.tolist())
    return state if isinstance(state, str | int | float | bool | None) else repr(state)
