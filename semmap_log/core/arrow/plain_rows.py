"""The rows of a table for programs that do not know Arrow: JSON, and CSV."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.model.moments import format_utc


def plain_rows(table: pa.Table) -> Iterator[dict[str, Any]]:
    """Yield rows, column -> value: times as text in UTC, bytes in hexadecimal, NaN as None."""
    columns = [_plain(table[name]) for name in table.column_names]
    for values in zip(*columns, strict=True):
        yield dict(zip(table.column_names, values, strict=True))


def write_csv(path: Path, table: pa.Table) -> None:
    """Write a table as CSV with a head: what is not known is empty.

    Raises:
        OSError: It cannot be written.
    """
    import csv

    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table.column_names)
        writer.writerows(row.values() for row in plain_rows(table))


def _plain(column: pa.ChunkedArray) -> list[Any]:
    if pa.types.is_timestamp(column.type):  # to Python's own times nanoseconds are lost
        times = column.cast(pa.int64()).to_pylist()
        return [None if time is None else format_utc(time) for time in times]
    values: list[Any] = column.to_pylist()
    if pa.types.is_binary(column.type):
        return [None if value is None else value.hex() for value in values]
    if pa.types.is_floating(column.type):
        return [None if value is None or math.isnan(value) else value for value in values]
    return values
