"""Cases: durable commits of one event, of many, and of many threads."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from benchmark.case import Case, Peer, Work
from benchmark.logs import Workshop
from benchmark.patrol import grouped, sightings

if TYPE_CHECKING:
    import semmap_log as sl
    from semmap_log.core.model.events import DoorObserved

PROMISES = {1: ("≥ 0.87x", "≥ 0.9x"), 100: ("≥ 0.77x", "≥ 1x")}
"""Events a commit -> what is promised against bare write + fdatasync and against SQLite."""

ROUNDS, BURST = 20, 10
THREADS, EACH = 8, 25
"""Threads that append together, and how many commits each of them makes in a turn."""

Row = tuple[int, int, int, float, float, float]
"""Happened, door, state, accuracy_open, accuracy_closed, opening."""


def append_cases(shop: Workshop, rounds: int | None) -> Iterator[Case]:
    """Yield: one commit after the other, each on the disk before the next."""
    for per_commit, (than_bare, than_sqlite) in PROMISES.items():
        turns = (1 + (rounds or ROUNDS)) * BURST
        folder = shop.folder_for(f"append_{per_commit}")
        shop.say(f"writing {turns} commits of {per_commit}")
        commits = _bytes_of_commits(folder / "sample", turns, per_commit)
        events = _digest(map(_row, sightings(turns * per_commit)))
        sizes = (turns, per_commit)
        peers = (
            Peer("semmap-log", partial(_ours, folder / "log", *sizes), events),
            Peer("the same bytes, write + fdatasync", partial(_bare, folder / "bytes", commits),
                 hashlib.sha256(b"".join(commits)).hexdigest(), promise=than_bare),
            Peer("SQLite, WAL, synchronous=FULL", partial(_sqlite, folder / "rows.db", *sizes),
                 events, promise=than_sqlite),
        )  # fmt: skip
        title = f"Durable append, {per_commit} a commit"
        yield Case("append", title, "µs", peers, rounds or ROUNDS, BURST)
    yield _group_commit(shop, rounds or ROUNDS)


def _group_commit(shop: Workshop, rounds: int) -> Case:
    """Return: threads that append at the same time, each waiting until its own is on the disk."""
    shop.say(f"writing from {THREADS} threads")
    folder = shop.folder_for("append_threads")
    turns, a_turn = 1 + rounds, THREADS * EACH
    plain = folder / "bytes"
    commits = _bytes_of_commits(folder / "sample", turns * a_turn, 1)
    peers = (
        Peer("semmap-log", partial(_ours_in_threads, folder / "log", turns),
             _digest(sorted(map(_row, sightings(turns * a_turn)))), units=a_turn),
        Peer("a loop of write + fdatasync", partial(_bare_bursts, plain, commits, a_turn),
             hashlib.sha256(b"".join(commits)).hexdigest(), units=a_turn, promise="≥ 5x"),
    )  # fmt: skip
    return Case("append", f"Durable append, {THREADS} threads", "events/s", peers, rounds)


def _bytes_of_commits(path: Path, commits: int, per_commit: int) -> list[bytes]:
    """Return what our log writes for each of these commits."""
    from semmap_log.store.reading.reader import LogReader

    with _new_log(path) as log:
        for events in grouped(sightings((commits + 1) * per_commit), per_commit):
            log.append(events, sync=False)
    (segment,) = LogReader(path).segments
    starts = [chunk.offset for chunk in segment.chunks]
    written = [bytes(segment.source.read(start, end)) for start, end in pairwise(starts)]
    return written[-commits:]  # not the last: behind it lies the segment's index


def _new_log(path: Path) -> sl.DoorLogWriter:
    """Make a log that has the doors which `sightings` sees, from before the first of these on."""
    import semmap_log as sl
    from semmap_log.core.model.doors import DoorId
    from semmap_log.core.model.events import DoorAdded

    log = sl.create(path, tz="UTC")
    doors = range(1, 101)
    log.append([DoorAdded(door_id=DoorId(door), x=1.0, y=1.0, theta=0.0, width=0.9, happened_ns=0)
                for door in doors])  # fmt: skip
    return log


def _ours(path: Path, commits: int, per_commit: int) -> Work:
    import semmap_log as sl
    from semmap_log.core.model.events import DoorObserved

    log = _new_log(path)

    def answer(_: object) -> str:
        log.close()
        batches = sl.read(path).batches(kinds=[DoorObserved])
        return _digest(_row(row.event) for batch in batches for row in batch)  # type: ignore[arg-type]

    return Work(log.append, grouped(sightings(commits * per_commit), per_commit), answer)


def _bare(path: Path, commits: list[bytes]) -> Work:
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)

    def once(data: bytes) -> None:
        os.write(fd, data)
        os.fdatasync(fd)

    return Work(once, iter(commits), lambda _: hashlib.sha256(path.read_bytes()).hexdigest())


def _ours_in_threads(path: Path, turns: int) -> Work:
    from concurrent.futures import ThreadPoolExecutor

    import semmap_log as sl
    from semmap_log.core.model.events import DoorObserved

    log = _new_log(path)
    pool = ThreadPoolExecutor(THREADS)

    def append_all(mine: list[list[DoorObserved]]) -> None:
        for events in mine:
            log.append(events)

    def once(shares: list[list[list[DoorObserved]]]) -> None:
        list(pool.map(append_all, shares))

    def answer(_: object) -> str:
        log.close()
        batches = sl.read(path).batches(kinds=[DoorObserved])
        return _digest(sorted(_row(row.event) for batch in batches for row in batch))  # type: ignore[arg-type]

    commits = grouped(sightings(turns * THREADS * EACH), 1)
    return Work(once, grouped(grouped(commits, EACH), THREADS), answer)


def _bare_bursts(path: Path, commits: list[bytes], a_turn: int) -> Work:
    one = _bare(path, commits)

    def once(burst: list[bytes]) -> None:
        for data in burst:
            one.once(data)

    return Work(once, grouped(iter(commits), a_turn), one.answer)


def _sqlite(path: Path, commits: int, per_commit: int) -> Work:
    import sqlite3

    database = sqlite3.connect(path, isolation_level=None)
    database.execute("PRAGMA journal_mode = WAL")
    database.execute("PRAGMA synchronous = FULL")
    database.execute(
        "CREATE TABLE observed (number INTEGER PRIMARY KEY, happened_ns INTEGER, door_id INTEGER, "
        "state INTEGER, accuracy_open REAL, accuracy_closed REAL, opening REAL)"
    )

    def once(rows: list[Row]) -> None:
        database.execute("BEGIN")
        database.executemany("INSERT INTO observed VALUES (NULL, ?, ?, ?, ?, ?, ?)", rows)
        database.execute("COMMIT")

    def answer(_: object) -> str:
        columns = "happened_ns, door_id, state, accuracy_open, accuracy_closed, opening"
        return _digest(database.execute(f"SELECT {columns} FROM observed ORDER BY number"))  # noqa: S608

    rows = map(_row, sightings(commits * per_commit))
    return Work(once, grouped(rows, per_commit), answer)


def _row(event: DoorObserved) -> Row:
    assert event.happened_ns is not None
    return (event.happened_ns, int(event.door_id), int(event.state), event.accuracy_open,
            event.accuracy_closed, event.opening)  # fmt: skip


def _digest(rows: Iterable[Row]) -> str:
    digest = hashlib.sha256()
    for row in rows:
        digest.update(repr(row).encode())
    return digest.hexdigest()
