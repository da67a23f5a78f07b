"""Cases: one door's history, and one day of a year."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmark import duckdb_peer, mcap_fold, sqlite_peer
from benchmark.case import Case, Peer, Work
from benchmark.folding import commit_sizes
from benchmark.logs import ZSTD, Sample, Workshop
from benchmark.patrol import POSE, START_NS, STEP_NS, blocks
from benchmark.peers import (
    DUCKDB,
    MCAP,
    OURS,
    SQLITE,
    on_cores,
    parquet_table,
    sqlite_table,
    there,
)

if TYPE_CHECKING:
    from semmap_log.batches.event_batch import EventBatch
    from semmap_log.domain.doors import DoorId

DOOR = 17
DAYS = 365
"""The log's time is taken as a year, whatever it is: a 365th of it is the day."""
DAY = 219
ROUNDS = 5

Stamps = list[tuple[int, int]]
"""Number and happened time of each event."""


def history_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: all events about a door."""
    from semmap_log.domain.doors import DoorId

    per_commit = commit_sizes(count)[-1]
    log = shop.log(count, per_commit, ZSTD)
    sample = log.sample()
    door = DoorId(min(DOOR, max(1, count // 20)))
    expected = _of_door(count, door)
    parquet = parquet_table(shop, count)
    peers = (
        Peer(f"{OURS}, history()", partial(_history, log.path, door), expected),
        Peer(f"{OURS}, batches()", partial(_door_batches, log.path, door), expected),
        Peer(MCAP, partial(_mcap_history, sample, door),
             [stamp for stamp in expected if stamp[0] < sample.count], sample.count / count),
        Peer(SQLITE, partial(_sqlite_history, sqlite_table(shop, count), door),
             expected),
        Peer(on_cores(DUCKDB, 1), partial(_duckdb_history, parquet, door), expected,
             beside=1, cores=1),
    )  # fmt: skip
    title = f"Door's history, {ZSTD}, {per_commit} a commit"
    yield Case("history", title, "ms", peers, rounds or ROUNDS, events=count, key="history")


def day_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: what happened in a small part of the log's time."""
    per_commit = commit_sizes(count)[-1]
    log = shop.log(count, per_commit, ZSTD)
    day_ns = count * STEP_NS // DAYS
    since_ns = START_NS + DAY * day_ns
    span = (since_ns, since_ns + day_ns)
    expected = _between(count, *span)
    parquet = parquet_table(shop, count)
    peers = (
        Peer(OURS, partial(_day, log.path, *span), expected),
        Peer("mcap + mcap-ros2-support, index", partial(_mcap_day, log.segments, *span),
             expected),
        Peer(SQLITE, partial(_sqlite_day, sqlite_table(shop, count), *span), expected),
        Peer(on_cores(DUCKDB, 1), partial(_duckdb_day, parquet, *span), expected, cores=1),
    )  # fmt: skip
    title = f"One day, {ZSTD}, {per_commit} a commit"
    yield Case("day", title, "ms", peers, rounds or ROUNDS, 3, events=count, key="day")


@cache
def _of_door(count: int, door: int) -> Stamps:
    chosen = (rows[(rows["door_id"] == door) & (rows["what"] != POSE)] for rows in blocks(count))
    return [stamp for rows in chosen for stamp in _stamps(rows)]


@cache
def _between(count: int, since_ns: int, until_ns: int) -> Stamps:
    chosen = (
        rows[(since_ns <= rows["happened_ns"]) & (rows["happened_ns"] < until_ns)]
        for rows in blocks(count)
    )
    return [stamp for rows in chosen for stamp in _stamps(rows)]


def _stamps(rows: Any) -> Stamps:
    return list(zip(rows["number"].tolist(), rows["happened_ns"].tolist(), strict=True))


def _of_batches(batches: list[EventBatch]) -> Stamps:
    return [
        stamp
        for batch in batches
        for stamp in zip(batch.number.tolist(), batch.folds_ns.tolist(), strict=True)
    ]


def _history(path: Path, door: DoorId) -> Work:
    import semmap_log as sl

    log = sl.read(path)
    return Work(
        lambda _: list(log.history(door)),
        answer=lambda entries: [(entry.number, entry.happened_ns) for entry in entries],
    )


def _door_batches(path: Path, door: DoorId) -> Work:
    import semmap_log as sl

    log = sl.read(path)
    return Work(lambda _: list(log.batches(doors=[door])), answer=_of_batches)


def _day(path: Path, since_ns: int, until_ns: int) -> Work:
    import semmap_log as sl

    log = sl.read(path)
    return Work(lambda _: list(log.batches(since=since_ns, until=until_ns)), answer=_of_batches)


def _mcap_history(sample: Sample, door: int) -> Work:
    return Work(lambda _: mcap_fold.mcap_history(sample, door))


def _mcap_day(files: tuple[Path, ...], since_ns: int, until_ns: int) -> Work:
    return Work(lambda _: mcap_fold.mcap_range(files, since_ns, until_ns))


def _sqlite_history(path: Path, door: int) -> Work:
    connection = sqlite_peer.connected(path)
    return Work(lambda _: sqlite_peer.history(connection, door), answer=_of_rows)


def _sqlite_day(path: Path, since_ns: int, until_ns: int) -> Work:
    connection = sqlite_peer.connected(path)
    return Work(lambda _: sqlite_peer.between(connection, since_ns, until_ns), answer=_of_rows)


def _duckdb_history(table: Path | None, door: int) -> Work:
    path, connection = there(table), duckdb_peer.connected(1)
    return Work(lambda _: duckdb_peer.history(connection, path, door), answer=_of_columns)


def _duckdb_day(table: Path | None, since_ns: int, until_ns: int) -> Work:
    path, connection = there(table), duckdb_peer.connected(1)
    return Work(
        lambda _: duckdb_peer.between(connection, path, since_ns, until_ns), answer=_of_columns
    )


def _of_rows(rows: list[tuple[Any, ...]]) -> Stamps:
    return sorted((row[0], row[1]) for row in rows)


def _of_columns(told: dict[str, Any]) -> Stamps:
    return list(zip(told["number"].tolist(), told["happened"].tolist(), strict=True))
