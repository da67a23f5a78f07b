"""The rows of an answer for programs that do not know Arrow: JSON, CSV, tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from datetime import date, datetime, time, timedelta, timezone
from decimal import Decimal
from typing import Any

import numpy as np

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.model.moments import format_utc
from semmap_log.core.texts import counted

_EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)


def answer_rows(answer: pa.Table) -> Iterator[tuple[Any, ...]]:
    """Yield rows as JSON knows them: instants are ISO-8601 UTC, bytes hexadecimal, NaN is None."""
    yield from zip(*(plain_values(column) for column in answer.columns), strict=True)


def json_rows(answer: pa.Table) -> Iterator[dict[str, Any]]:
    """Yield the same by the names of the columns; of two of one name the second is `name_1`."""
    names = column_names(answer)
    for row in answer_rows(answer):
        yield dict(zip(names, row, strict=True))


def column_names(answer: pa.Table) -> list[str]:
    """Return the names of an answer's columns, each once."""
    found: list[str] = []
    for name in answer.column_names:
        again = (f"{name}_{count}" for count in range(1, len(answer.column_names) + 1))
        found.append(name if name not in found else next(n for n in again if n not in found))
    return found


def instants_ns(column: pa.ChunkedArray) -> list[int | None] | None:
    """Return a column of instants as nanoseconds UTC; None: it is another."""
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
    except (OverflowError, ValueError):  # a time that Python cannot tell, such as infinity
        return [_far_time(value) for value in column]


def _far_time(value: pa.Scalar) -> Any:
    """Return a time that may be none of Python's, which knows the years 1 to 9999."""
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
