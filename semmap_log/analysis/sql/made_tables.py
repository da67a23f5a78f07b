"""Rows that Python makes one by one, as Arrow tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import Any

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.schema import schema_of, type_of
from semmap_log.core.arrow.table_columns import Column

AT_ONCE = 10_000
"""Rows of a table."""


def query_schema(columns: Sequence[Column], *more: pa.Field) -> pa.Schema:
    """Return the schema by which queries see columns: times in microseconds, as SQL has them."""
    fields = [
        field.with_type(pa.timestamp("us", field.type.tz))
        if pa.types.is_timestamp(field.type)
        else field
        for field in schema_of(columns)
    ]
    return pa.schema([*fields, *more])


def made_tables(columns: Sequence[Column], rows: Iterable[Sequence[Any]]) -> Iterator[pa.Table]:
    """Yield rows as tables: NaN becomes null, an instant is nanoseconds UTC.

    Args:
        columns: In the order of the rows' values.
        rows: As many as there are; a table is made of a part of them.
    """
    waiting = iter(rows)
    while part := list(islice(waiting, AT_ONCE)):
        yield made_table(columns, part)


def made_table(columns: Sequence[Column], rows: Sequence[Sequence[Any]]) -> pa.Table:
    """Return rows as one table: see `made_tables`."""
    values = list(zip(*rows, strict=True)) or [()] * len(columns)
    arrays = [
        pa.array(each, type_of(column), from_pandas=True)
        for column, each in zip(columns, values, strict=True)
    ]
    return pa.Table.from_arrays(arrays, names=[column.name for column in columns])
