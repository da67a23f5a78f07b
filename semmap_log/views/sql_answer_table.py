"""Tables of query answers: times by the log's clocks, numbers aligned to the right."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from rich.text import Text

from semmap_log.analysis.sql.answer_rows import answer_rows, column_names, instants_ns
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.model.moments import format_local
from semmap_log.views.column_table import Cell, CellValue, ColumnTable, TableColumn
from semmap_log.views.event_words import printable
from semmap_log.views.tables import ABSENT

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
