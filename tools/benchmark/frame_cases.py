"""Cases: events as an Arrow table, a few columns of all of them, and all columns."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

from benchmark import duckdb_peer
from benchmark.case import Case, Peer, Work
from benchmark.folding import commit_sizes
from benchmark.logs import LIVE, ZSTD, Workshop
from benchmark.patrol import blocks
from benchmark.peers import DUCKDB, OURS, on_cores, parquet_table, there

ROUNDS = 3
HOT = ("event", "kind", "door_id", "happened", "recorded", "state")
SAID = ("door_name", "level_name", "actor", "source", "reason", "correlation", "retracted")

Sums = tuple[int, int]
"""Of all event numbers, and of all happened times, nanoseconds modulo 2^63."""


def frame_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: every event of the log as a row, on one core."""
    per_commit = commit_sizes(count)[-1]
    expected = _sums(count)
    parquet = parquet_table(shop, count)
    for form in (LIVE, ZSTD):
        path = shop.log(count, per_commit, form).path
        peers = (
            Peer(f"{OURS}, {len(HOT)} columns", partial(_table, path, HOT), expected, count,
                 cores=1),
            Peer(f"{OURS}, and names, who, why", partial(_table, path, (*HOT, *SAID)), expected,
                 count, cores=1),
            Peer(f"{OURS}, all columns", partial(_table, path, None), expected, count, cores=1),
            Peer(f"{OURS}, read, no table", partial(_read, path), expected, count, cores=1),
            Peer(on_cores(DUCKDB, 1), partial(_duckdb, parquet), expected, count, cores=1),
        )  # fmt: skip
        title = f"Events as a table, {form}, {per_commit} a commit"
        yield Case("frame", title, "events/s", peers, rounds or ROUNDS, events=count,
                   memory_promise=False, key=f"frame {form}")  # fmt: skip


@cache
def _sums(count: int) -> Sums:
    number = happened = 0
    for rows in blocks(count):
        number += int(rows["number"].sum())
        happened += int(rows["happened_ns"].astype(object).sum())
    return number, happened % 2**63


def _table(path: Path, columns: tuple[str, ...] | None) -> Work:
    import semmap_log as sl

    log = sl.read(path)
    return Work(lambda _: log.to_arrow(columns=columns), answer=_sums_of_table)


def _sums_of_table(table: Any) -> Sums:
    times = table["happened"].cast("int64").to_numpy()
    return _of_columns(table["event"].to_numpy(), times)


def _of_columns(numbers: Any, happened_ns: Any) -> Sums:
    return int(numbers.sum()), int(happened_ns.astype(object).sum()) % 2**63


def _read(path: Path) -> Work:
    import numpy as np

    import semmap_log as sl

    log = sl.read(path)

    def read(_: object) -> tuple[Any, Any]:
        parts = [(batch.number, batch.happened_ns) for batch in log.batches()]
        numbers, times = zip(*parts, strict=True)
        return np.concatenate(numbers), np.concatenate(times)

    return Work(read, answer=lambda found: _of_columns(*found))


def _duckdb(path: Path | None) -> Work:
    connection, file = duckdb_peer.connected(1), str(there(path))
    query = "SELECT number, door_id, happened, state FROM read_parquet(?)"

    def read(_: object) -> Any:
        return connection.execute(query, (file,)).fetchnumpy()

    return Work(read, answer=lambda found: _of_columns(found["number"], found["happened"]))
