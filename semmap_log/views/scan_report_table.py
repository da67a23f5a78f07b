"""Tables of a scan report and of query answers, for people.

A scan report has a row for each door, and names those that need a look. A query's answer shows
times by the log's clocks, and aligns numbers to the right.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from math import isfinite
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.scans.door_figures import DoorFigures, ScanReport
from semmap_log.analysis.sql.answer_rows import answer_rows, column_names, instants_ns
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.model.moments import format_local
from semmap_log.core.texts import counted
from semmap_log.views.column_table import Cell, CellValue, ColumnTable, TableColumn
from semmap_log.views.event_words import printable
from semmap_log.views.sightings.visit_words import share
from semmap_log.views.tables import ABSENT

MARK = "!"
"""Of a door that a warning is about."""
MOST_NAMED = 12
"""Up to so many doors that were not met are listed by name."""


def scan_report_table(report: ScanReport) -> RenderableType:
    """Return a table of a row a door, in 80 columns, followed by notes on what is odd."""
    table = ColumnTable([
        TableColumn("door", "door", least=12),
        TableColumn("visits", "visits", right=True),
        TableColumn("open", "open", right=True),
        TableColumn("closed", "closed", right=True),
        TableColumn("undecided", "undecided", right=True),
        TableColumn("driven_through", "driven\nthrough", right=True, yields=3),
        TableColumn("said_accuracy", "said\naccuracy", right=True, yields=1),
        TableColumn("opening", "opening", right=True, yields=4),
        TableColumn("behind_m", "ends\nbehind", right=True, yields=2),
    ])  # fmt: skip
    for door in report.doors:
        table.add(*_cells(report, door))
    parts: list[RenderableType] = [table] if report.doors else [Text("no door was visited.")]
    return Group(*parts, *(Text(line, style="dim") for line in _below(report)))


def warning_lines(report: ScanReport) -> list[str]:
    """Return the warnings, with the doors' names."""
    about = [warning.about(report.label(warning.door_id)) for warning in report.warnings]
    return [printable(line) for line in (*about, *report.oddities)]


def _cells(report: ScanReport, door: DoorFigures) -> list[str | CellValue]:
    name = printable(report.label(door.door_id))
    mark = f" {MARK}" if report.warnings_of(door.door_id) else ""
    behind = door.behind_m.value
    return [
        CellValue(Text(f"{name}{mark}", style="bold" if mark else ""), name),
        *(str(n) for n in (door.visits, door.open, door.closed, door.undecided, door.passed)),
        _share(door.accuracy.value),
        _share(door.opening.value),
        CellValue(f"{behind:+.2f} m" if isfinite(behind) else "-", _told(behind, "+.3f")),
    ]


def _share(value: float) -> CellValue:
    return CellValue(share(value) if isfinite(value) else "-", _told(value, ".4f"))


def _told(value: float, form: str) -> str:
    return format(value, form) if isfinite(value) else "-"


def _below(report: ScanReport) -> list[str]:
    lines = []
    if report.not_met:
        named = [printable(report.label(door_id)) for door_id in report.not_met[:MOST_NAMED]]
        more = ", …" if len(report.not_met) > MOST_NAMED else ""
        lines.append(f"never met: {counted(len(report.not_met), 'door')}: {', '.join(named)}{more}")
    return ["", *lines] if lines else []


PAGE_ROWS = 500
TEXT_WIDTH = 12
"""Texts may fold down to it."""


def answer_pages(answer: pa.Table, *, tz: str) -> Iterator[ColumnTable]:
    """Yield an answer as tables; the first has the head.

    Args:
        answer: Of a query.
        tz: IANA zone of the times.
    """
    for start in range(0, max(answer.num_rows, 1), PAGE_ROWS):
        page = answer.slice(start, PAGE_ROWS)
        table = ColumnTable(_columns(answer), has_head=start == 0)
        cells = [_times(column, tz) for column in page.columns]
        for place, row in enumerate(answer_rows(page)):
            table.add(
                *(
                    _cell(value) if known is None else known[place]
                    for value, known in zip(row, cells, strict=True)
                )
            )
        yield table


def _columns(answer: pa.Table) -> list[TableColumn]:
    found = []
    for name, field in zip(column_names(answer), answer.schema, strict=True):
        right = _is_number(field.type)
        found.append(
            TableColumn(name, printable(name), right=right, least=None if right else TEXT_WIDTH)
        )
    return found


def _is_number(type_: pa.DataType) -> bool:
    kinds = (pa.types.is_integer, pa.types.is_floating, pa.types.is_decimal)
    return any(is_one(type_) for is_one in kinds)


def _times(column: pa.ChunkedArray, tz: str) -> list[Cell] | None:
    """Return instants for people and for programs; None: the column has none."""
    ns = instants_ns(column)
    if ns is None:
        return None
    return [ABSENT if each is None else format_local(each, tz) for each in ns]


def _cell(value: Any) -> Cell:
    if value is None:
        return ABSENT
    if isinstance(value, float):
        return CellValue(f"{value:.6g}", repr(value))
    if isinstance(value, bool | list | dict):
        return Text(printable(json.dumps(value, ensure_ascii=False)))
    return Text(printable(str(value)))
