"""Cases: events counted by door and hour of the building's clocks, in SQL."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Iterator
from datetime import datetime, timezone
from functools import cache, partial
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np

from benchmark import duckdb_peer
from benchmark.case import Case, Peer, Work
from benchmark.folding import commit_sizes
from benchmark.logs import ZSTD, Workshop
from benchmark.patrol import POSE, blocks
from benchmark.peers import DUCKDB, OURS, on_cores

ROUNDS = 5
HOUR_NS = 3600 * 10**9
MOST_HOURS = 2**32
"""Since 1970."""
QUERY = """
    SELECT door_id, hour(happened) AS hour, count(*) FROM {events}
    GROUP BY ALL ORDER BY ALL NULLS FIRST
"""

Counts = list[tuple[int | None, int, int]]
"""Door, hour of the day, how many events."""


def sql_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: with the read model and without, beside DuckDB over what we export."""
    per_commit = commit_sizes(count)[-1]
    plain = shop.log(count, per_commit, ZSTD).path
    indexed = _indexed(shop, plain, count)
    zone, exported = _export(indexed)
    expected = _counts(count, zone)
    ours, theirs = partial(_ours, indexed), partial(_duckdb, exported, zone)
    peers = (
        Peer(on_cores(f"{OURS}, index", 2), ours, expected, cores=2),
        Peer(on_cores(f"{OURS}, index", 1), ours, expected, cores=1),
        Peer(f"{OURS}, no index", partial(_ours, plain), expected, cores=2),
        Peer(on_cores(f"{DUCKDB} as exported", 2), partial(theirs, 2), expected, promise="≥ 1x",
             cores=2),
        Peer(on_cores(f"{DUCKDB} as exported", 1), partial(theirs, 1), expected, promise="≥ 1x",
             beside=1, cores=1),
    )  # fmt: skip
    title = f"SQL: by door and hour, {ZSTD}, {per_commit} a commit"
    yield Case("sql", title, "ms", peers, rounds or ROUNDS, memory_promise=False, events=count,
               key="sql")  # fmt: skip


def _indexed(shop: Workshop, log: Path, count: int) -> Path:
    """Return a copy of a log that has its tables: other cases are asked without."""
    from semmap_log.log.replay.read_model.indexing import index

    shop.say(f"indexing {count:,} events")
    copy = shop.folder_for(f"{count}_indexed") / log.name
    shutil.copytree(log, copy)
    index(copy)
    return copy


def _export(log: Path) -> tuple[str, Path]:
    """Return a log's zone, and the file that it is exported to."""
    import semmap_log as sl
    from semmap_log.interop.exporting.log_files import export

    opened, out = sl.read(log), log.parent / "exported.parquet"
    export(opened, out)
    return opened.info.timezone, out


@cache
def _counts(count: int, zone: str) -> Counts:
    found: Counter[tuple[int, int]] = Counter()
    for rows in blocks(count):
        doors = np.where(rows["what"] == POSE, -1, rows["door_id"].astype(np.int64))
        keys = doors * MOST_HOURS + rows["happened_ns"] // HOUR_NS
        unique, times = np.unique(keys, return_counts=True)
        for key, number in zip(unique.tolist(), times.tolist(), strict=True):
            door, hour = divmod(key, MOST_HOURS)
            found[door, _local_hour(hour, zone)] += number
    return [(None if door < 0 else door, hour, n) for (door, hour), n in sorted(found.items())]


@cache
def _local_hour(hour: int, zone: str) -> int:
    """Return the hour of the day that clocks show in an hour since 1970; zones of whole hours."""
    return datetime.fromtimestamp(hour * 3600, timezone.utc).astimezone(ZoneInfo(zone)).hour


def _ours(path: Path) -> Work:
    import semmap_log as sl

    log = sl.read(path)
    return Work(lambda _: log.sql(QUERY.format(events="events")).fetchall())


def _duckdb(table: Path, zone: str, threads: int) -> Work:
    connection = duckdb_peer.connected(threads)
    connection.execute(f"SET TimeZone = '{zone}'")
    query = QUERY.format(events=f"read_parquet('{table}')")
    return Work(lambda _: connection.execute(query).fetchall())
