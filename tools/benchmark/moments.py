"""Cases: the door map at a random moment, of an open log and of one that nobody has touched."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, nullcontext
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmark import daily_snapshots, duckdb_peer, mcap_fold, sqlite_peer
from benchmark.case import Case, Peer, Work
from benchmark.folding import LARGEST, commit_sizes
from benchmark.logs import DAY_NS, LIVE, ZSTD, BenchLog, Sample, Workshop
from benchmark.patrol import START_NS, STEP_NS
from benchmark.peers import (
    DUCKDB,
    MCAP,
    OURS,
    SNAPSHOTS,
    SQLITE,
    on_cores,
    parquet_table,
    snapshot_table,
    sqlite_table,
    there,
)
from benchmark.plain_fold import (
    Answer,
    PlainFold,
    answer_of,
    answer_of_rows,
    plain_answer,
    plain_answers,
)
from benchmark.worker import drop_from_memory

if TYPE_CHECKING:
    from semmap_log.core.model.doors import DoorMap

MOMENTS = 50
"""So many different ones are asked for, in turn."""
CHECKED = 3
"""The answers to the first ones are compared, once more at the end."""
PROMISED = 10_000_000
"""What is promised beside DuckDB, and of the bytes, holds for logs from this size on."""
ROUNDS, BURST, BURST_S = 10, 20, 0.5
COLD_BURST = 2


def moment_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: warm and cold, compacted; each way to ask; warm, live."""
    per_commit = commit_sizes(count)[-1]
    log = shop.log(count, per_commit, ZSTD)
    yield _warm_case(shop, log, ZSTD, per_commit, rounds)
    yield _ways_case(log, per_commit, rounds)
    yield _cold_case(shop, log, per_commit, rounds)
    if count < LARGEST:
        yield _warm_case(shop, shop.log(count, per_commit, LIVE), LIVE, per_commit, rounds)


def moments(count: int) -> list[int]:
    """Return moments between a patrol's start and its end, the same at each run.

    They are spread so that the first few, which are all that a slow peer is asked for, lie as
    evenly as all of them do (van der Corput's sequence): later moments cost most peers more.
    """
    span_ns = count * STEP_NS
    return [START_NS + int(_reversed_bits(n) * span_ns) for n in range(1, MOMENTS + 1)]


def _reversed_bits(number: int) -> float:
    """Return a number's binary digits mirrored at the point: of 1, 2, 3 that is 0.1, 0.01, 0.11."""
    digits = f"{number:b}"
    return int(digits[::-1], 2) / (1 << len(digits))


def _warm_case(
    shop: Workshop, log: BenchLog, form: str, per_commit: int, rounds: int | None
) -> Case:
    count, sample = log.count, log.sample()
    expected = _expected(count)
    peers = [
        Peer(OURS, partial(_ours, log.path, count), expected),
        Peer(MCAP, partial(_mcap, sample, count), _expected(count, sample.count),
             sample.count / count),
    ]  # fmt: skip
    if form == ZSTD:
        peers += _tables(shop, count, cold=False)
        peers.append(Peer(on_cores(SNAPSHOTS, 1),
                          partial(_snapshots, snapshot_table(shop, count), count), expected,
                          cores=1))  # fmt: skip
    title = f"Moment, warm, {form}, {per_commit} a commit"
    return Case("moment", title, "ms", tuple(peers), rounds or ROUNDS, BURST, BURST_S,
                events=count, key=f"moment, {form}",
                tail_promise="< 5 ms" if form == ZSTD else "",
                worst_promise="< 10 ms" if form == ZSTD else "",
                growth_promise="< 2x" if form == ZSTD else None)  # fmt: skip


def _ways_case(log: BenchLog, per_commit: int, rounds: int | None) -> Case:
    """Return: what was true, what was known, up to an event, and what was known of the day before.

    Recorded was each commit with its last event.
    """
    count, asked = log.count, moments(log.count)[:CHECKED]
    known = [(at_ns - START_NS) // (STEP_NS * per_commit) * per_commit for at_ns in asked]
    numbers = [_number_at(at_ns) + 1 for at_ns in asked]
    expected = {
        "at": _expected(count),
        "known_at": [plain_answer(count, first) for first in known],
        "event": [plain_answer(count, first) for first in numbers],
        "both, a day apart": [
            plain_answer(count, first, at_ns - DAY_NS)
            for first, at_ns in zip(known, asked, strict=True)
        ],
    }
    peers = tuple(Peer(f"{OURS}, {way}", partial(_our_way, log.path, count, way), answers)
                  for way, answers in expected.items())  # fmt: skip
    title = f"Moment, each way, {ZSTD}, {per_commit} a commit"
    return Case("moment", title, "ms", peers, rounds or ROUNDS, BURST, BURST_S, events=count,
                key="moment, ways", tail_promise="< 5 ms", worst_promise="< 10 ms")  # fmt: skip


def _number_at(at_ns: int) -> int:
    return (at_ns - START_NS) // STEP_NS


def _cold_case(shop: Workshop, log: BenchLog, per_commit: int, rounds: int | None) -> Case:
    """Return: opening included, none of the bytes in memory."""
    ours = Peer(OURS, partial(_ours_cold, log), _expected(log.count), store_bytes=log.bytes)
    peers = (ours, *_tables(shop, log.count, cold=True))
    title = f"Moment, cold, {ZSTD}, {per_commit} a commit"
    return Case("moment", title, "ms", peers, rounds or ROUNDS, COLD_BURST, BURST_S,
                events=log.count, tail_promise="", growth_promise="", key="moment, cold",
                share_promise="< 1 %" if log.count >= PROMISED else "")  # fmt: skip


def _tables(shop: Workshop, count: int, *, cold: bool) -> Iterator[Peer]:
    expected, parquet = _expected(count), parquet_table(shop, count)
    size = parquet.stat().st_size if parquet else 0
    promise = "≥ 100x" if count >= PROMISED else ""
    for cores in (1, 2):
        work = partial(_duckdb, parquet, count, cores, cold=cold)
        yield Peer(on_cores(DUCKDB, cores), work, expected, promise=promise, cores=cores,
                   store_bytes=size if cold else 0)  # fmt: skip
    table = sqlite_table(shop, count)
    yield Peer(SQLITE, partial(_sqlite, table, count, cold=cold), expected,
               store_bytes=table.stat().st_size if cold else 0)  # fmt: skip


def _expected(count: int, first: int | None = None) -> list[Answer]:
    asked = tuple(moments(count)[:CHECKED])
    told = plain_answers(count, first, asked)
    return [told[at_ns] for at_ns in asked]


def _work(
    at: Callable[[int], Any], told: Callable[[Any], Answer], count: int, cold: Sequence[Path] = ()
) -> Work:
    """Return the work of a peer that can say how the doors were at a moment.

    Args:
        at: Timed: a moment's result.
        told: Not timed: the result as an answer.
        count: Events of the patrol.
        cold: Files that are dropped from memory before each turn.
    """

    def inputs() -> Iterator[int]:
        for at_ns in cycle(moments(count)):
            drop_from_memory(cold)
            yield at_ns

    return Work(at, inputs(), lambda _: [told(at(at_ns)) for at_ns in moments(count)[:CHECKED]])


def _ours(path: Path, count: int) -> Work:
    import semmap_log as sl

    return _work(sl.read(path).replay, answer_of, count)


def _our_way(path: Path, count: int, way: str) -> Work:
    import semmap_log as sl

    log = sl.read(path)
    ask: dict[str, Callable[[int], DoorMap]] = {
        "at": log.replay,
        "known_at": lambda at_ns: log.replay(known_at=at_ns),
        "event": lambda at_ns: log.replay(event=_number_at(at_ns)),
        "both, a day apart": lambda ns: log.replay(at=ns - DAY_NS, known_at=ns),
    }
    return _work(ask[way], answer_of, count)


def _snapshots(table: Path | None, count: int) -> Work:
    connection = daily_snapshots.connected(there(table), 1)
    return _work(partial(daily_snapshots.door_map, connection), answer_of_rows, count)


def _ours_cold(log: BenchLog) -> Work:
    import semmap_log as sl

    def at(at_ns: int) -> DoorMap:
        return sl.read(log.path).replay(at_ns)

    return _work(at, answer_of, log.count, log.segments)


def _mcap(sample: Sample, count: int) -> Work:
    return _work(partial(mcap_fold.mcap_replay, sample), PlainFold.answer, count)


def _duckdb(table: Path | None, count: int, threads: int, *, cold: bool) -> Work:
    path, connection = there(table), duckdb_peer.connected(threads)

    def at(at_ns: int) -> list[tuple[Any, ...]]:
        with duckdb_peer.connected(threads) if cold else nullcontext(connection) as used:
            return duckdb_peer.door_map(used, path, at_ns)

    return _work(at, answer_of_rows, count, [path] if cold else [])


def _sqlite(path: Path, count: int, *, cold: bool) -> Work:
    connection = sqlite_peer.connected(path)

    def at(at_ns: int) -> list[tuple[Any, ...]]:
        if not cold:
            return sqlite_peer.door_map(connection, at_ns)
        with closing(sqlite_peer.connected(path)) as used:
            return sqlite_peer.door_map(used, at_ns)

    return _work(at, answer_of_rows, count, [path] if cold else [])
