"""The rows of the view `events`, of what a query asks for."""

from __future__ import annotations

from collections.abc import Iterator

from semmap_log.analysis.sql.made_tables import query_schema
from semmap_log.analysis.sql.possible_rows import possible_doors, possible_windows
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.event_view import EVENT_VIEW, as_event_view, history_columns
from semmap_log.core.arrow.scanned_table import ScanRequest
from semmap_log.log.door_log.door_log import DoorLog

EVENT_SCHEMA = query_schema(EVENT_VIEW)


def event_rows(log: DoorLog, asked: ScanRequest) -> Iterator[pa.Table]:
    """Yield the events that a filter can match, in any order."""
    needed, doors = history_columns(asked.columns), possible_doors(log, asked)
    windows = [] if doors == [] else possible_windows(log, asked)
    for table in log.unordered_tables(windows, needed, doors):
        yield as_event_view(table, asked.columns)
