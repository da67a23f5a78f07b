"""The views of a log: each is made when a query scans it, of what the query's filter can match."""

from __future__ import annotations

from collections.abc import Iterator

from semmap_log.analysis.sql.event_rows import EVENT_SCHEMA, event_rows
from semmap_log.analysis.sql.made_tables import query_schema
from semmap_log.analysis.sql.moment_rows import DOOR_SCHEMA, door_table
from semmap_log.analysis.sql.possible_rows import possible_doors, possible_windows
from semmap_log.analysis.sql.row_making import RowMaking
from semmap_log.analysis.sql.span_rows import (
    change_tables,
    commit_tables,
    interval_tables,
    patrol_tables,
    pose_tables,
)
from semmap_log.analysis.sql.view_columns import EVENTS, VIEWS
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.scanned_table import Read, ScannedTable, ScanRequest
from semmap_log.log.door_log.door_log import DoorLog


def log_views(log: DoorLog, making: RowMaking) -> dict[str, ScannedTable]:
    """Return the views of a log, by name.

    Args:
        log: The log.
        making: Takes in what goes wrong while rows are made.
    """
    schemas = {name: query_schema(columns) for name, columns in VIEWS.items()}
    schemas |= {EVENTS: EVENT_SCHEMA, "doors": DOOR_SCHEMA}
    readers = _readers(log)
    return {
        name: ScannedTable(schema, making.tables(readers[name]))
        for name, schema in sorted(schemas.items())
    }


def _readers(log: DoorLog) -> dict[str, Read]:
    """Return what makes the rows of each view."""

    def doors(_: ScanRequest) -> Iterator[pa.Table]:
        yield door_table(log.replay())

    def intervals(asked: ScanRequest) -> Iterator[pa.Table]:
        ids = possible_doors(log, asked)
        return iter(()) if ids == [] else interval_tables(log, ids)

    def changes(asked: ScanRequest) -> Iterator[pa.Table]:
        ids = possible_doors(log, asked)
        for window in [] if ids == [] else possible_windows(log, asked):
            yield from change_tables(log, window, ids)

    def poses(asked: ScanRequest) -> Iterator[pa.Table]:
        for window in possible_windows(log, asked):
            yield from pose_tables(log, window)

    return {
        EVENTS: lambda asked: event_rows(log, asked),
        "doors": doors,
        "intervals": intervals,
        "changes": changes,
        "commits": lambda _: commit_tables(log),
        "patrols": lambda _: patrol_tables(log),
        "poses": poses,
    }
