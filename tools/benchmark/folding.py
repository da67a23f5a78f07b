"""Cases: the door map, by reading the whole log, and as it is now."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from benchmark import duckdb_peer, limit, mcap_fold, sqlite_peer
from benchmark.case import Case, Peer, Work
from benchmark.logs import FORMS, LIVE, PLAIN, ZSTD, BenchLog, Sample, Workshop
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
from benchmark.plain_fold import (
    Answer,
    PlainFold,
    answer_of,
    answer_of_rows,
    plain_answer,
)

PER_COMMIT = (1, 10, 100)
SMALL = 1000
"""Below, a run only tries out whether everything works, as the tests do."""
LARGE, LARGEST = 1_000_000, 5_000_000
"""Events from which on only some logs are made: those of one event a commit take 400 bytes each."""
ROUNDS = 3

THAN_MCAP = {
    (LIVE, 1): "≥ 20x", (LIVE, 10): "≥ 20x", (LIVE, 100): "≥ 34x",
    (PLAIN, 1): "≥ 80x", (PLAIN, 10): "≥ 150x", (PLAIN, 100): "≥ 150x",
    (ZSTD, 1): "≥ 80x", (ZSTD, 10): "≥ 150x", (ZSTD, 100): "≥ 150x",
}  # fmt: skip
PROMISED = 10_000_000
"""Beside DuckDB that is promised for logs from this size on."""
THAN_DUCKDB = {PLAIN: "≥ 1x", ZSTD: "≥ 0.5x"}


def fold_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: every event of the log read and folded, for each form of log."""
    for form in FORMS if count < LARGEST else (PLAIN, ZSTD):  # none that is live is so long
        for per_commit in commit_sizes(count):
            yield _fold_case(shop, shop.log(count, per_commit, form), form, per_commit, rounds)


def now_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: the state as it is now, of a log that was just opened."""
    per_commit = commit_sizes(count)[-1]
    log = shop.log(count, per_commit, ZSTD)
    answer = plain_answer(count)
    peers = (
        Peer(OURS, partial(_now, log.path), answer),
        Peer(SQLITE, partial(_sqlite_now, sqlite_table(shop, count)), answer),
        Peer(on_cores(DUCKDB, 1), partial(_duckdb, parquet_table(shop, count), 1), answer,
             cores=1),
    )  # fmt: skip
    title = f"State now, {ZSTD}, {per_commit} a commit"
    yield Case("now", title, "ms", peers, rounds or ROUNDS, events=count, key="now")


def commit_sizes(count: int) -> tuple[int, ...]:
    """Return for how many events a commit a log of that size is made."""
    if count < SMALL:
        return PER_COMMIT[-1:]
    least = 1 if count < LARGE else 10 if count < LARGEST else 100
    return tuple(size for size in PER_COMMIT if size >= least)


def _fold_case(
    shop: Workshop, log: BenchLog, form: str, per_commit: int, rounds: int | None
) -> Case:
    ours, mcap = _reading_peers(log, form, per_commit)
    peers = [ours, mcap]
    if per_commit == commit_sizes(log.count)[-1]:  # the others read the same whatever the commits
        two = Peer(on_cores(OURS, 2), ours.prepare, ours.expected, log.count, cores=2)
        peers = [ours, two, mcap, *_other_peers(shop, log, form)]
    peers.append(_limit(log, form))
    title = f"Whole log, {form}, {per_commit} a commit"
    return Case("fold", title, "events/s", tuple(peers), rounds or ROUNDS, events=log.count,
                key=f"fold, {form}, {per_commit}")  # fmt: skip


def _reading_peers(log: BenchLog, form: str, per_commit: int) -> tuple[Peer, Peer]:
    count, sample = log.count, log.sample()
    ours = Peer(on_cores(OURS, 1), partial(_fold, log.path), plain_answer(count), count, cores=1)
    mcap = Peer(MCAP, partial(_mcap, sample), plain_answer(count, sample.count),
                sample.count, THAN_MCAP[form, per_commit], cores=1)  # fmt: skip
    return ours, mcap


def _other_peers(shop: Workshop, log: BenchLog, form: str) -> Iterator[Peer]:
    count, answer = log.count, plain_answer(log.count)
    if form != LIVE:
        parquet = parquet_table(shop, count)
        promise = THAN_DUCKDB[form] if count >= PROMISED else ""
        for cores in (1, 2):
            yield Peer(on_cores(DUCKDB, cores), partial(_duckdb, parquet, cores), answer, count,
                       promise, beside=cores - 1, cores=cores)  # fmt: skip
    if form == ZSTD:
        yield Peer(SQLITE, partial(_sqlite, sqlite_table(shop, count)), answer, count,
                   cores=1)  # fmt: skip


def _limit(log: BenchLog, form: str) -> Peer:
    if form == LIVE:
        return Peer("limit: crc32 + numpy", partial(_limit_files, log.segments),
                    limit.whole_files_expected(log.segments), log.count, cores=1)  # fmt: skip
    name = f"limit: {'zstd + ' if form == ZSTD else ''}crc32 + numpy"
    return Peer(name, partial(_limit_records, log.segments),
                limit.all_records_expected(log.segments), log.count, cores=1)  # fmt: skip


def _fold(path: Path) -> Work:
    import semmap_log as sl
    from semmap_log.core.folds.door_map import DoorMapState

    def once(_: None) -> DoorMapState:
        state = DoorMapState()
        for batch in sl.read(path).batches():
            state.apply(batch)
        return state

    def answer(state: DoorMapState) -> Answer:
        return answer_of(state.door_map())

    return Work(once, answer=answer)


def _now(path: Path) -> Work:
    import semmap_log as sl

    return Work(lambda _: sl.read(path).replay(), answer=answer_of)


def _mcap(sample: Sample) -> Work:
    import mcap_ros2.decoder  # noqa: F401 - not timed

    return Work(lambda _: mcap_fold.mcap_replay(sample), answer=PlainFold.answer)


def _duckdb(path: Path | None, threads: int) -> Work:
    table, connection = there(path), duckdb_peer.connected(threads)
    return Work(lambda _: duckdb_peer.door_map(connection, table), answer=answer_of_rows)


def _sqlite(path: Path) -> Work:
    connection = sqlite_peer.connected(path)
    return Work(lambda _: sqlite_peer.whole_fold(connection), answer=answer_of_rows)


def _sqlite_now(path: Path) -> Work:
    return Work(lambda _: sqlite_peer.door_map(sqlite_peer.connected(path)), answer=answer_of_rows)


def _limit_files(files: tuple[Path, ...]) -> Work:
    import numpy as np  # noqa: F401 - not timed

    return Work(lambda _: limit.whole_files(files))


def _limit_records(files: tuple[Path, ...]) -> Work:
    import numpy as np  # noqa: F401 - not timed

    places = tuple(mcap_fold.stored_chunks(files))
    return Work(lambda _: limit.all_records(places))
