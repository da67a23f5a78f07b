"""Cases: replay of the whole log, a moment in it, opening it."""

from __future__ import annotations

import random
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from benchmark.case import Case, Peer, Work
from benchmark.logs import DAILY_STATES, BenchLog, Workshop, write_days
from benchmark.patrol import START_NS, STEP_NS
from benchmark.plain_fold import PlainFold, answer_of, plain_answer

PER_COMMIT = (1, 10, 100)
YEARS_OF_DAYS = 1825
"""Five years, a segment a day."""
MCAP = "mcap + mcap-ros2-support, fold"
REPLAY_PROMISES = {
    ("live", 1): "≥ 20x", ("live", 10): "≥ 20x", ("live", 100): "≥ 20x",
    ("compacted", 1): "≥ 80x", ("compacted", 10): "≥ 150x", ("compacted", 100): "≥ 150x",
}  # fmt: skip


def replay_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: the door map over the whole log, as it was written and compacted."""
    for form in ("live", "compacted"):
        for per_commit in PER_COMMIT:
            log = shop.log(count, per_commit, compacted=form == "compacted")
            start = log.start()
            ours = Peer("semmap-log", partial(_replay, log.path), plain_answer(count), count)
            mcap = Peer(
                MCAP, partial(_mcap_replay, start.segments), plain_answer(count, start.count),
                start.count, REPLAY_PROMISES[form, per_commit],
            )  # fmt: skip
            title = f"Replay, {form}, {per_commit} a commit"
            yield Case("replay", title, "events/s", (ours, mcap), rounds or 5, events=count)


def moment_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: the door map at a random moment of an open log."""
    rounds = rounds or 5
    log = shop.log(count, 10, compacted=True)
    start = log.start()
    *_, last_ns = (moment for moment, _ in zip(_moments(count), range(1 + rounds), strict=False))
    ours = Peer("semmap-log", partial(_moment, log), plain_answer(count, at_ns=last_ns))
    mcap = Peer(MCAP, partial(_mcap_moment, start.segments, count),
                plain_answer(count, start.count, last_ns), start.count / count)  # fmt: skip
    title = "Random moment, compacted, 10 a commit"
    yield Case("moment", title, "ms", (ours, mcap), rounds, events=count)


def open_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: a log opened for reading."""
    for form, per_commit in (("live", 1), ("compacted", 10)):
        log = shop.log(count, per_commit, compacted=form == "compacted")
        start = log.start()
        ours = Peer("semmap-log", partial(_open, log.path), sum(log.chunks))
        mcap = Peer("mcap, all summaries", partial(_mcap_open, start.segments), sum(start.chunks),
                    start.count / count)  # fmt: skip
        title = f"Opening, {form}, {per_commit} a commit"
        yield Case("open", title, "ms", (ours, mcap), rounds or 5, events=count)


def crash_case(shop: Workshop, rounds: int | None) -> Case:
    """Return: a log of five years opened to go on with, after a crash."""
    path = shop.folder_for("years") / "log"
    shop.say(f"writing {YEARS_OF_DAYS:,} segments")
    write_days(path, YEARS_OF_DAYS)
    files = tuple(sorted(path.glob("*.mcap")))
    stored = 1 + (YEARS_OF_DAYS - 1) * len(DAILY_STATES) - 1  # the last one is torn
    ours = Peer("semmap-log", partial(_append_after_crash, path), stored)
    mcap = Peer("mcap, all summaries but the last's", partial(_mcap_open, files[:-1]),
                2 + (YEARS_OF_DAYS - 2) * (1 + len(DAILY_STATES)))  # fmt: skip
    title = f"After a crash, {YEARS_OF_DAYS:,} segments"
    return Case("open", title, "ms", (ours, mcap), rounds or 5)


def _moments(count: int) -> Iterator[int]:
    """Yield moments between a patrol's start and its end, the same at each run."""
    rng = random.Random(7)
    while True:
        yield START_NS + rng.randrange(count * STEP_NS)


def _replay(path: Path) -> Work:
    import semmap_log as sl

    return Work(lambda _: sl.read(path).replay(), answer=answer_of)


def _mcap_replay(files: tuple[Path, ...]) -> Work:
    from benchmark.mcap_fold import mcap_replay

    return Work(lambda _: mcap_replay(files), answer=PlainFold.answer)


def _moment(log: BenchLog) -> Work:
    import semmap_log as sl

    opened = sl.read(log.path)
    return Work(lambda at_ns: opened.replay(at=at_ns), _moments(log.count), answer_of)


def _mcap_moment(files: tuple[Path, ...], count: int) -> Work:
    from benchmark.mcap_fold import mcap_replay

    return Work(lambda at_ns: mcap_replay(files, at_ns), _moments(count), PlainFold.answer)


def _open(path: Path) -> Work:
    import semmap_log as sl

    return Work(
        lambda _: sl.read(path),
        answer=lambda log: sum(len(segment.chunks) for segment in log.reader.segments),
    )


def _append_after_crash(path: Path) -> Work:
    import semmap_log as sl

    last = max(path.glob("*.mcap"))
    torn = last.read_bytes()
    opened: list[sl.DoorLogWriter] = []

    def crashed() -> Iterator[None]:
        """Put the torn segment back before each turn."""
        while True:
            while opened:
                opened.pop().close()
            last.unlink()
            last.write_bytes(torn)
            yield

    def once(_: None) -> None:
        opened.append(sl.append(path, compact=False))

    def answer(_: None) -> int:
        (log,) = opened
        return log.replay().event + 1

    return Work(once, crashed(), answer)


def _mcap_open(files: tuple[Path, ...]) -> Work:
    from benchmark.mcap_fold import mcap_chunks

    return Work(lambda _: mcap_chunks(files))
