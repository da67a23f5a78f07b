"""Tables -> one Parquet file, group by group: in flat memory, and the same bytes for equal rows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from semmap_log.arrow.sdk import pa, pq

GROUP_ROWS = 2**16
"""Rows in a group: what a reader can skip, or read on a core of its own."""

GROUP_BYTES = 64 * 2**20
"""A group ends earlier where floor maps make it so big."""

RISING = ("event", "happened", "recorded")
"""Columns that nearly count: their differences are stored, in a tenth of the bytes."""


def write_parquet(
    path: Path, tables: Iterable[pa.Table], schema: pa.Schema, said: Mapping[str, str]
) -> int:
    """Write tables of one schema as one file, zstd, and return how many rows there were.

    Args:
        path: The file; an old one is written over.
        tables: One after the other, of any length.
        schema: Of all of them.
        said: What the file says of itself besides, key -> text.

    Raises:
        OSError: It cannot be written.
    """
    rows = 0
    schema = schema.with_metadata({**schema.metadata, **said})
    with pq.ParquetWriter(
        path,
        schema,
        compression="zstd",
        use_dictionary=[name for name in schema.names if name not in RISING],
        column_encoding=dict.fromkeys(RISING, "DELTA_BINARY_PACKED"),
    ) as writer:
        for group in _groups(tables):
            writer.write_table(group.replace_schema_metadata(schema.metadata))
            rows += group.num_rows
    return rows


def _groups(tables: Iterable[pa.Table]) -> Iterator[pa.Table]:
    """Yield the same rows in tables of `GROUP_ROWS`, however they were cut before."""
    waiting: list[pa.Table] = []
    for table in tables:
        waiting.append(table)
        if sum(part.num_rows for part in waiting) >= GROUP_ROWS:
            joined = pa.concat_tables(waiting)
            whole = joined.num_rows - joined.num_rows % GROUP_ROWS
            for start in range(0, whole, GROUP_ROWS):
                yield joined.slice(start, GROUP_ROWS).combine_chunks()
            waiting = [joined.slice(whole)]
        elif sum(part.nbytes for part in waiting) > GROUP_BYTES:
            yield pa.concat_tables(waiting)
            waiting = []
    if sum(part.num_rows for part in waiting):
        yield pa.concat_tables(waiting).combine_chunks()
