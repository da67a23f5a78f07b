"""The rows of an answer for programs that do not know Arrow: JSON, CSV, tables.

A query's answer is written to a file whole or not at all.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import date, datetime, time, timedelta, timezone
from decimal import Decimal
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from semmap_log.core.arrow.arrow_sdk import pa, pq
from semmap_log.core.io.disk import atomic_file, output_errors
from semmap_log.core.model.moments import format_utc
from semmap_log.core.texts import counted
from semmap_log.errors import FormatError


def write_answer(answer: pa.Table, out: Path) -> None:
    """Write an answer to a file, in the format that the file's suffix names.

    Raises:
        FormatError: The suffix names no format.
        OutputError: It cannot be written; an existing file stays.
    """
    write = writer_for(out)
    try:
        with output_errors(out), atomic_file(out) as temporary:
            write(answer, temporary)
    except (pa.ArrowNotImplementedError, pa.ArrowInvalid) as error:
        raise FormatError(out, f"{error}; write it as .csv or .json.") from None


def writer_for(out: Path) -> Callable[[pa.Table, Path], None]:
    """Return the function that writes an answer to a file of that name.

    Raises:
        FormatError: The suffix names no format.
    """
    write = _WRITERS.get(out.suffix.lower())
    if write is None:
        known = ", ".join(_WRITERS)
        raise FormatError(out, f"unknown extension for an answer; expected one of: {known}.")
    return write


def csv_lines(answer: pa.Table, file: TextIO) -> None:
    """Write an answer as CSV with a head: null is empty, a list or a map is JSON."""
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(column_names(answer))
    writer.writerows(map(_csv_row, answer_rows(answer)))


def _csv_row(row: Iterable[object]) -> list[object]:
    return [
        json.dumps(value, ensure_ascii=False) if isinstance(value, list | dict) else value
        for value in row
    ]


def _write_parquet(answer: pa.Table, path: Path) -> None:
    columns = [_storable(answer.column(place)) for place in range(answer.num_columns)]
    table = pa.Table.from_arrays(columns, names=column_names(answer))
    with path.open("wb") as file:
        pq.write_table(table, file, compression="zstd")


def _storable(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return a column as Parquet can hold it: intervals as text, as in the other files."""
    if column.type != pa.month_day_nano_interval():
        return column
    return pa.chunked_array([pa.array(plain_values(column), pa.string())])


def _write_csv(answer: pa.Table, path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        csv_lines(answer, file)


def _write_json(answer: pa.Table, path: Path) -> None:
    with path.open("w", encoding="utf-8") as file:
        opening = "["
        for row in json_rows(answer):
            file.write(f"{opening}\n{json.dumps(row, ensure_ascii=False)}")
            opening = ","
        file.write("[]\n" if opening == "[" else "\n]\n")


_WRITERS: dict[str, Callable[[pa.Table, Path], None]] = {
    ".parquet": _write_parquet,
    ".csv": _write_csv,
    ".json": _write_json,
}


_EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)


def answer_rows(answer: pa.Table) -> Iterator[tuple[Any, ...]]:
    """Yield rows as JSON knows them: instants are ISO-8601 UTC, bytes hexadecimal, NaN is None."""
    yield from zip(*(plain_values(column) for column in answer.columns), strict=True)


def json_rows(answer: pa.Table) -> Iterator[dict[str, Any]]:
    """Yield rows by column names; the second of two equal names becomes `name_1`."""
    names = column_names(answer)
    for row in answer_rows(answer):
        yield dict(zip(names, row, strict=True))


def column_names(answer: pa.Table) -> list[str]:
    """Return unique names of an answer's columns."""
    found: list[str] = []
    for name in answer.column_names:
        again = (f"{name}_{count}" for count in range(1, len(answer.column_names) + 1))
        found.append(name if name not in found else next(n for n in again if n not in found))
    return found


def instants_ns(column: pa.ChunkedArray) -> list[int | None] | None:
    """Return a column of instants as nanoseconds UTC; None: it is of another type."""
    if not pa.types.is_timestamp(column.type) or column.type.tz is None:
        return None
    try:
        ns: list[int | None] = column.cast(pa.timestamp("ns", "UTC")).cast(pa.int64()).to_pylist()
    except pa.ArrowInvalid:  # one of before 1678 or after 2262, or none: infinity
        return None
    return ns


def plain_values(column: pa.ChunkedArray) -> list[Any]:
    """Return the values of one column so."""
    ns = instants_ns(column)
    if ns is not None:  # to Python's own times nanoseconds would be lost
        return [None if each is None else format_utc(each) for each in ns]
    if pa.types.is_timestamp(column.type):
        column = column.cast(pa.timestamp("us", column.type.tz), safe=False)
    if pa.types.is_map(column.type):
        return [None if value is None else _map(value) for value in column.to_pylist()]
    try:
        return [_value(value) for value in column.to_pylist()]
    except (OverflowError, ValueError):  # a time that Python cannot represent, such as infinity
        return [_far_time(value) for value in column]


def _far_time(value: pa.Scalar) -> Any:
    """Return a time that may be outside Python's range, the years 1 to 9999."""
    try:
        return _value(value.as_py())
    except (OverflowError, ValueError):
        if isinstance(value, pa.ListScalar):
            return [_far_time(each) for each in value.values]
        if not pa.types.is_temporal(value.type):
            return "out of range"
        is_date = pa.types.is_date(value.type)
        if abs(value.value) == (2**31 - 1 if is_date else 2**63 - 1):
            return "infinity" if value.value > 0 else "-infinity"
        return str(np.array(value.value).astype("datetime64[D]" if is_date else "datetime64[us]"))


def _map(pairs: list[tuple[Any, Any]]) -> dict[str, Any]:
    return {str(_value(key)): _value(each) for key, each in pairs}


def _value(value: Any) -> Any:
    match value:
        case None | bool() | int() | str():
            return value
        case float():
            return value if math.isfinite(value) else None
        case Decimal():
            return int(value) if value == value.to_integral_value() else float(value)
        case bytes():
            return value.hex()
        case datetime() if value.tzinfo is not None:
            return format_utc((value - _EPOCH) // timedelta(microseconds=1) * 1000)
        case datetime() | date() | time():
            return value.isoformat()
        case pa.MonthDayNano(months=months, days=days, nanoseconds=ns):
            return _duration(months, days, ns)
        case timedelta():
            return _duration(0, 0, value // timedelta(microseconds=1) * 1000)
        case Mapping():
            return {str(key): _value(each) for key, each in value.items()}
        case list() if value and all(isinstance(each, tuple) for each in value):
            return _map(value)
        case list():
            return [_value(each) for each in value]
        case _:
            return str(value)


def _duration(months: int, days: int, ns: int) -> str:
    """Return a span of time as DuckDB writes it: `2 months 3 days 00:25:00`."""
    parts = [counted(count, unit) for count, unit in ((months, "month"), (days, "day")) if count]
    if ns or not parts:
        seconds, left = divmod(abs(ns), 10**9)
        clock = f"{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}"
        fraction = f".{left:09}".rstrip("0") if left else ""
        parts.append(f"{'-' if ns < 0 else ''}{clock}{fraction}")
    return " ".join(parts)
