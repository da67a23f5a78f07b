"""Cases: one door's history, the index that makes it quick, and one day of a year."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmark import duckdb_peer, mcap_fold, sqlite_peer
from benchmark.case import Case, Peer, Work
from benchmark.folding import LARGEST, commit_sizes
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
from benchmark.plain_fold import states, writers

if TYPE_CHECKING:
    from semmap_log.core.batches.event_batch import EventBatch
    from semmap_log.core.model.doors import DoorId

DOOR = 17
DAYS = 365
"""The log's time is taken as a year, whatever it is: a 365th of it is the day."""
DAY = 219
ROUNDS, MAKING_ROUNDS = 5, 3

Stamps = list[tuple[int, int]]
"""Number and happened time of each event."""


def history_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: all events about a door, as objects and as columns, without an index and with one."""
    from semmap_log.core.model.doors import DoorId

    per_commit = commit_sizes(count)[-1]
    log = shop.log(count, per_commit, ZSTD)
    sample = log.sample()
    door = DoorId(min(DOOR, max(1, count // 20)))
    expected = _of_door(count, door)
    parquet = parquet_table(shop, count)
    peers = [
        Peer(f"{OURS}, history()", partial(_history, log.path, door), expected),
        Peer(f"{OURS}, batches()", partial(_door_batches, log.path, door), expected),
        Peer(MCAP, partial(_mcap_history, sample, door),
             [stamp for stamp in expected if stamp[0] < sample.count], sample.count / count),
    ]  # fmt: skip
    indexed = indexed_log(shop, count, per_commit)
    if indexed is not None:
        peers += [
            Peer(f"{OURS}, history(), index", partial(_history, indexed, door), expected),
            Peer(f"{OURS}, batches(), index", partial(_door_batches, indexed, door), expected),
            Peer(f"{OURS}, timeline(), index", partial(_timeline, indexed, door),
                 _states_of_door(count, door)),
        ]  # fmt: skip
    columns = min(4, len(peers) - 2)
    peers += [
        Peer(SQLITE, partial(_sqlite_history, sqlite_table(shop, count), door), expected,
             beside=columns),
        Peer(on_cores(DUCKDB, 1), partial(_duckdb_history, parquet, door), expected,
             promise="≥ 1x" if count >= LARGEST else "", beside=columns, cores=1),
    ]  # fmt: skip
    title = f"Door's history, {ZSTD}, {per_commit} a commit"
    yield Case("history", title, "ms", tuple(peers), rounds or ROUNDS, events=count, key="history")


def index_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: the index of a log made anew, beside a table sorted by door that DuckDB makes."""
    per_commit = commit_sizes(count)[-1]
    indexed, parquet = indexed_log(shop, count, per_commit), parquet_table(shop, count)
    if indexed is None:
        return
    peers = (
        Peer(OURS, partial(_indexing, indexed), count, units=count),
        Peer(on_cores(f"{DUCKDB}, sorted", 2), partial(_duckdb_sorting, parquet, indexed), count,
             units=count, cores=2),
    )  # fmt: skip
    title = f"Index made, {ZSTD}, {per_commit} a commit"
    yield Case("index", title, "events/s", peers, rounds or MAKING_ROUNDS, events=count,
               memory_promise=False, key="index")  # fmt: skip


def indexed_log(shop: Workshop, count: int, per_commit: int) -> Path | None:
    """Return a second folder of a patrol's compacted log, with an index; None: no pyarrow."""
    from semmap_log.log.replay.read_model.events_about import has_pyarrow
    from semmap_log.log.replay.read_model.indexing import index

    path = shop.log(count, per_commit, ZSTD).path
    indexed = path.with_name("indexed") / path.name
    if not has_pyarrow():
        return None
    if not indexed.exists():
        shop.say(f"indexing {count:,} events, {per_commit} a commit")
        shutil.copytree(path, indexed, copy_function=os.link)
        index(indexed)
    return indexed


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


@cache
def _states_of_door(count: int, door: int) -> Stamps:
    """Return when each state of a door began, and which it was, from its adding on."""
    told: list[tuple[int, int, int]] = []
    added = (0, 0)
    for rows in blocks(count):
        chosen = (rows["door_id"] == door) & writers(rows)["state"]
        happened, numbers = rows["happened_ns"][chosen].tolist(), rows["number"][chosen].tolist()
        told += zip(happened, numbers, states(rows)[chosen].tolist(), strict=True)
        for row in rows[chosen & writers(rows)["added"]]:
            added = (int(row["happened_ns"]), int(row["number"]))
    told = sorted(one for one in told if one[:2] >= added)
    told = [
        one for one, after in zip(told, [*told[1:], (-1, 0, 0)], strict=True) if one[0] != after[0]
    ]  # of one moment the last counts
    return [
        (happened_ns, state)
        for place, (happened_ns, _, state) in enumerate(told)
        if not place or told[place - 1][2] != state
    ]


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


def _timeline(path: Path, door: DoorId) -> Work:
    import semmap_log as sl

    log = sl.read(path)
    return Work(
        lambda _: log.timeline(door),
        answer=lambda told: list(zip(told.start_ns.tolist(), told.state.tolist(), strict=True)),
    )


def _indexing(path: Path) -> Work:
    from semmap_log.log.replay.read_model.indexing import Indexed, index

    def note(done: Indexed) -> str:
        return f"{done.size / done.log_size:.0%} of the log's bytes"

    return Work(lambda _: index(path, anew=True), answer=lambda done: done.events, note=note)


def _duckdb_sorting(table: Path | None, beside: Path) -> Work:
    path, connection = there(table), duckdb_peer.connected(2)
    target = beside.with_name("sorted.parquet")
    return Work(lambda _: duckdb_peer.write_sorted(connection, path, target))


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
