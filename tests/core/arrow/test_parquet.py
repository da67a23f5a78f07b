"""The Parquet file itself: groups, bytes, memory."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from semmap_log.core.arrow import parquet
from semmap_log.core.arrow.parquet import write_parquet

SCHEMA = pa.schema({name: pa.int64() for name in ("event", "happened", "recorded", "other")})


def table(first: int, rows: int) -> pa.Table:
    return pa.table([pa.array(np.arange(first, first + rows))] * 4, schema=SCHEMA.with_metadata({}))


def cut(rows: int, size: int) -> Iterator[pa.Table]:
    """Yield `rows` rows in tables of that size."""
    for first in range(0, rows, size):
        yield table(first, min(size, rows - first))


@pytest.mark.parametrize("size", [1, 7, 64, 100, 1000])
def test_equal_rows_give_equal_bytes_however_they_are_cut(
    size: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A log that was compacted since is exported as the same file."""
    monkeypatch.setattr(parquet, "GROUP_ROWS", 64)
    schema = SCHEMA.with_metadata({"a": "b"})

    rows = write_parquet(tmp_path / "x", cut(1000, size), schema, {"c": "d"})
    write_parquet(tmp_path / "whole", iter([table(0, 1000)]), schema, {"c": "d"})

    found = pq.read_metadata(tmp_path / "x")
    assert 1000 == rows
    assert [64] * 15 + [40] == [found.row_group(i).num_rows for i in range(16)]
    assert list(range(1000)) == pq.read_table(tmp_path / "x").column("event").to_pylist()
    assert (tmp_path / "whole").read_bytes() == (tmp_path / "x").read_bytes()
    assert (b"b", b"d") == (found.metadata[b"a"], found.metadata[b"c"])


def test_pages_of_long_texts_do_not_show_how_they_were_cut(tmp_path: Path) -> None:
    """A page ends where it is full, not where a table ended."""
    dice = random.Random(3)
    texts = pa.array([dice.randbytes(2000).hex() for _ in range(1000)])
    schema = pa.schema({**dict.fromkeys(SCHEMA.names, pa.int64()), "text": pa.string()})
    schema = schema.with_metadata({})
    whole = pa.table([*table(0, 1000).columns, texts], schema=schema)

    write_parquet(tmp_path / "x", (whole.slice(i, 300) for i in range(0, 1000, 300)), schema, {})
    write_parquet(tmp_path / "whole", iter([whole]), schema, {})

    found = pq.read_metadata(tmp_path / "x").row_group(0).column(4)
    assert (tmp_path / "whole").read_bytes() == (tmp_path / "x").read_bytes()
    assert "ZSTD" == found.compression


def test_a_file_of_no_rows_has_its_columns(tmp_path: Path) -> None:
    """The export of an empty log is a file that can be read."""
    assert 0 == write_parquet(tmp_path / "x", iter([]), SCHEMA.with_metadata({}), {})

    assert SCHEMA.names == pq.read_table(tmp_path / "x").column_names


def test_groups_are_written_as_the_tables_come(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Memory does not grow with the log."""
    monkeypatch.setattr(parquet, "GROUP_ROWS", 1000)
    sizes = []

    def watched() -> Iterator[pa.Table]:
        for part in cut(10_000, 1000):
            sizes.append((tmp_path / "x").stat().st_size)
            yield part

    write_parquet(tmp_path / "x", watched(), SCHEMA.with_metadata({}), {})

    assert 10 == len(sizes)
    assert sorted(set(sizes)) == sizes


def test_a_group_ends_early_where_its_rows_are_big(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Floor maps: few rows, many bytes."""
    monkeypatch.setattr(parquet, "GROUP_BYTES", 100)

    write_parquet(tmp_path / "x", cut(20, 2), SCHEMA.with_metadata({}), {})

    found = pq.read_metadata(tmp_path / "x")
    assert [4] * 5 == [found.row_group(i).num_rows for i in range(found.num_row_groups)]
