"""Tables that are made when a query scans them, with no more than it needs.

DuckDB gives a pyarrow dataset the columns and the filter that it wants, and leaves the filtering to
it. The filter is not parsed to find which parts of a log can match: pyarrow decides that, from
datasets whose files are never opened, each with a guarantee of what its rows are like.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from semmap_log.core.arrow.arrow_sdk import pa  # isort: skip - it reports a missing pyarrow
import pyarrow.dataset as pads  # another 60 ms, which nothing but queries needs
import pyarrow.fs as pafs

BATCH_ROWS = 2**17
"""Rows that are handed over at a time, at most."""

Guarantee = Any
"""An expression of pyarrow that holds for all rows of a part."""


class ScanRequest:
    """What a query asks of a table."""

    def __init__(self, schema: pa.Schema, columns: Sequence[str] | None, filter_: Any) -> None:
        self._schema, self._filter = schema, filter_
        self._told = "" if filter_ is None else str(filter_)
        wanted = set(schema.names if columns is None else columns) or {schema.names[0]}
        self.columns = tuple(
            name for name in schema.names if name in wanted or self.filters_by(name)
        )
        """Those that are shown or filtered by, in the order of the schema; at least one."""

    def has(self, name: str) -> bool:
        """Return whether the table has such a column, requested or not."""
        return name in self._schema.names

    def filters_by(self, name: str) -> bool:
        """Return whether the filter names a column; perhaps that is only the text of a value."""
        return re.search(rf"\b{re.escape(name)}\b", self._told) is not None

    def possible(self, guarantees: Sequence[Guarantee]) -> list[int]:
        """Return the places of the parts in which a row may pass the filter.

        Args:
            guarantees: Of each part.
        """
        if self._filter is None:
            return list(range(len(guarantees)))
        parts = pads.FileSystemDataset.from_paths(
            [str(place) for place in range(len(guarantees))],
            schema=self._schema,
            format=pads.ParquetFileFormat(),
            filesystem=pafs.LocalFileSystem(),
            partitions=list(guarantees),
        )
        return sorted(int(part.path) for part in parts.get_fragments(self._filter))


Read = Callable[[ScanRequest], Iterable[pa.Table]]
"""Yields tables with at least the requested columns, and all rows that may match."""


class ScannedTable(pads.Dataset):  # type: ignore[misc]
    """A table for DuckDB, which asks it again for every query."""

    def __init__(self, schema: pa.Schema, read: Read) -> None:
        self._schema_of_all, self._read = schema, read

    @property
    def schema(self) -> pa.Schema:
        """Of all columns."""
        return self._schema_of_all

    def scanner(self, columns: Any = None, filter: Any = None, **_: Any) -> Any:  # noqa: A002
        """Return what reads some columns of the rows that pass a filter."""
        request = ScanRequest(self.schema, columns, filter)
        shown = request.columns if filter is not None or columns is None else columns
        schema = pa.schema([self.schema.field(name) for name in shown])
        if filter is None:
            return _Unfiltered(schema, _fitting(self._read(request), schema))
        return pads.Scanner.from_batches(
            _fitting(self._read(request), schema), schema=schema, columns=columns, filter=filter
        )


class _Unfiltered:
    """What reads all rows: a scanner would only look at each once more."""

    def __init__(self, schema: pa.Schema, batches: Iterator[pa.RecordBatch]) -> None:
        self.projected_schema = schema
        self._batches = batches

    def to_reader(self) -> pa.RecordBatchReader:
        """Return the rows."""
        return pa.RecordBatchReader.from_batches(self.projected_schema, self._batches)


def _fitting(tables: Iterable[pa.Table], schema: pa.Schema) -> Iterator[pa.RecordBatch]:
    for table in tables:
        fitting = pa.Table.from_arrays(
            [_as_type(table[field.name], field.type) for field in schema], schema=schema
        )
        yield from fitting.to_batches(max_chunksize=BATCH_ROWS)


def _as_type(column: pa.ChunkedArray, type_: pa.DataType) -> pa.ChunkedArray:
    """Return a column as another type; of times, what is finer than the type is cut off."""
    return column if column.type == type_ else column.cast(type_, safe=False)


def between(name: str, least: Any, greatest: Any) -> Guarantee:
    """Return that a column is never null, and lies between two scalars, both inclusive."""
    field = pads.field(name)
    return (field >= least) & (field <= greatest)


def equal(name: str, value: Any) -> Guarantee:
    """Return that a column has one value; None: it is null."""
    field = pads.field(name)
    return field.is_null() if value is None else field == value


def microseconds(ns: int) -> pa.Scalar:
    """Return an instant as the tables of queries have it: what is finer is cut off."""
    return pa.scalar(ns // 1000, pa.timestamp("us", "UTC"))
