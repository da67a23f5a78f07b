"""Several who want to write one log, and many who read it while it is written."""

from __future__ import annotations

import multiprocessing
import os
import random
import signal
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.process import BaseProcess
from pathlib import Path
from queue import Empty

import semmap_log as sl
from fault_injection.fault import Outcome, Plan
from fault_injection.sample import compact_folder, small_segments
from semmap_log.core.model.events import RobotPose
from semmap_log.errors import LogLockedError
from semmap_log.store.reading.reader import LogReader

READING_S = 60.0
RACERS = 3
RACES = 30
MOST_EVENTS_A_COMMIT = 5
COMMITS_A_SEGMENT = 25
_spawn = multiprocessing.get_context("spawn")


def rivals(plan: Plan) -> Generator[Outcome, None, None]:
    """Let processes race for a log; then read one for a minute while everything happens to it."""
    yield from race(plan.folder / "race", races=plan.most(RACES))
    yield from read_during_everything(plan.folder / "busy", plan.seed, seconds=READING_S)


def race(folder: Path, *, races: int = RACES) -> Iterator[Outcome]:
    """Let processes open, append and close one log as fast as they can, again and again.

    Who gets in appends once; who does not is told so, and has changed nothing.
    """
    log = folder / "log"
    folder.mkdir()
    sl.create(log, tz="UTC").close()
    answers = _spawn.Queue()
    acknowledged: list[tuple[int, int]] = []
    with _children(_racer, [(log, races, n, answers) for n in range(RACERS)]) as racers:
        for _ in range(races * RACERS):
            acknowledged.append(answers.get(timeout=300))
            yield Outcome(f"race of {RACERS} writers: commit {len(acknowledged)}", checked=1)
        for racer in racers:
            racer.join(300)
    stored = [(e.number, int(e.event.x)) for b in sl.read(log).batches() for e in b]
    lost = sum(answer not in stored for answer in acknowledged)
    invented = sum(event not in acknowledged for event in stored)
    yield Outcome(f"race of {RACERS} writers, at its end", len(acknowledged), lost, invented)


def _racer(
    log: Path, races: int, name: int, answers: multiprocessing.Queue[tuple[int, int]]
) -> None:
    for turn in range(races):
        while True:
            try:
                with sl.append(log) as writer:
                    value = name * 1_000_000 + turn
                    appended = writer.append([RobotPose(x=float(value), y=0.0, theta=0.0)])
                break
            except LogLockedError:
                time.sleep(0.001)
        answers.put((appended.first_event, value))


def read_during_everything(folder: Path, seed: int, *, seconds: float) -> Iterator[Outcome]:
    """Read a log over and over while it is written, rolled, compacted, killed and recovered.

    Every reading is a prefix of the final log, ends with a whole commit, and is not shorter than
    the one before.
    """
    log = folder / "log"
    folder.mkdir()
    sl.create(log, tz="UTC").close()
    _write_once(log, random.Random(seed), COMMITS_A_SEGMENT)
    until = time.monotonic() + seconds
    said = _spawn.Queue()
    readers = [(log, until, way, said) for way in WAYS_TO_READ]
    with _children(_reader, readers), _children(_busy_writer, [(log, until, seed)]) as (writer,):
        supervised = _keep_writing(writer, log, until, random.Random(seed))
        kills = sum(1 for _ in supervised)
        for _ in readers:
            try:
                way, readings, problem = said.get(timeout=300)
            except Empty:
                way, readings, problem = "?", 0, "a reader that says nothing"
            yield Outcome(
                f"{way} for {seconds:.0f} s during {kills} kills: {readings:,} readings",
                readings,
                problem=problem,
            )
    after = sl.read(log)
    events, problem = _check_prefix(after)
    segments = len(LogReader(log).segments)
    yield Outcome(f"the log after all that: {events} events, {segments} segments", 1, 0, 0, problem)


def _keep_writing(
    writer: BaseProcess, log: Path, until: float, dice: random.Random
) -> Iterator[None]:
    """Kill the writer now and then and start another: yields once for each kill."""
    while time.monotonic() < until:
        before = _bytes_of(log)
        while time.monotonic() < until and writer.is_alive() and _bytes_of(log) == before:
            time.sleep(0.01)
        time.sleep(dice.uniform(0.1, 1.0))
        if writer.is_alive() and dice.random() < 0.7:
            os.kill(writer.pid or 0, signal.SIGKILL)
            yield
        if not writer.is_alive():
            writer.join()
            writer = _spawn.Process(target=_busy_writer, args=(log, until, dice.random()))
            writer.start()
    writer.join(300)


def _bytes_of(log: Path) -> int:
    with suppress(FileNotFoundError):  # of a file that is being replaced
        return sum(path.stat().st_size for path in log.glob("*.mcap"))
    return 0


def _busy_writer(log: Path, until: float, seed: float) -> None:
    """Append, roll, close, compact and reopen until the time is over."""
    dice = random.Random(seed)
    with small_segments(COMMITS_A_SEGMENT, chunk_bytes=200):
        while time.monotonic() < until:
            _write_once(log, dice, dice.randrange(60))
            if dice.random() < 0.5:
                compact_folder(log)


def _write_once(log: Path, dice: random.Random, commits: int) -> None:
    with sl.append(log) as writer:
        following = sum(len(batch) for batch in writer.batches_in())
        for _ in range(commits):
            following += _append(writer, following, dice.randrange(1, MOST_EVENTS_A_COMMIT))


def _append(log: sl.DoorLogWriter, first: int, count: int) -> int:
    """Append a commit whose events say their number, and how many come after them in it."""
    log.append(
        [RobotPose(x=float(first + i), y=float(count - 1 - i), theta=0.0) for i in range(count)],
        sync=False,
    )
    return count


def _reader(
    log: Path, until: float, way: str, said: multiprocessing.Queue[tuple[str, int, str]]
) -> None:
    readings, problem, seen = 0, "", 0
    try:
        for now, wrong in WAYS_TO_READ[way](log, until):
            readings += 1
            problem = wrong or (f"{now} events after {seen} were there" if now < seen else "")
            if problem:
                break
            seen = now
    except BaseException as error:  # noqa: BLE001  # whatever it is, it is the finding
        problem = f"reading {readings}: {error!r}"
    said.put((way, readings, problem))


Reading = tuple[int, str]
"""How many events there are, and what is wrong with them."""


def _opened_anew(log: Path, until: float) -> Iterator[Reading]:
    while time.monotonic() < until:
        yield _check_prefix(sl.read(log))


def _refreshed(log: Path, until: float) -> Iterator[Reading]:
    opened = sl.read(log)
    while time.monotonic() < until:
        opened.refresh()
        yield _check_prefix(opened)


def _followed(log: Path, until: float) -> Iterator[Reading]:
    following = sl.read(log).follow(-1, poll_s=0.01, stop=lambda: time.monotonic() >= until)
    count = 0
    for followed in following:
        for recorded in followed:
            event = recorded.event
            if not isinstance(event, RobotPose) or event.x != count or recorded.number != count:
                yield count, f"event {count} is {event!r}"
            count += 1
        yield count, "" if followed.commit.last_event == count - 1 else "half a commit"


WAYS_TO_READ: dict[str, Callable[[Path, float], Iterator[Reading]]] = {
    "opening and reading": _opened_anew,
    "refreshing and reading": _refreshed,
    "following": _followed,
}


def _check_prefix(log: sl.DoorLog) -> Reading:
    """Return how many events there are, and what is wrong with them."""
    count, waited_for = 0, 0.0
    for batch in log.batches():
        for recorded in batch:
            event = recorded.event
            if not isinstance(event, RobotPose) or event.x != count or recorded.number != count:
                return count, f"event {count} is {event!r}"
            waited_for = event.y
            count += 1
    commits = sum(commit.count for commit in log.commits())
    if waited_for:
        return count, f"half a commit: {waited_for:.0f} events are missing behind {count}"
    return count, "" if commits == count else f"{count} events, {commits} in commits"


@contextmanager
def _children(
    target: Callable[..., None], arguments: list[tuple[object, ...]]
) -> Iterator[list[BaseProcess]]:
    """Run processes; end those that are still there afterwards."""
    children = [_spawn.Process(target=target, args=args) for args in arguments]
    try:
        for child in children:
            child.start()
        yield list(children)
    finally:
        for child in children:
            with suppress(ValueError):
                child.kill()
                child.join()
