"""Sectors of 512 bytes that a disk gives back as zeros, as they once were, or as another's."""

from __future__ import annotations

import random
from collections.abc import Callable, Generator
from functools import partial

from fault_injection.fault import Outcome, Plan
from fault_injection.judging import copy_of
from fault_injection.sample import COMMITS_A_SEGMENT, make_sample
from fault_injection.subject import Subject

SECTOR = 512


def sectors(plan: Plan) -> Generator[Outcome, None, None]:
    """Damage every sector of a live and of a closed log, in every way there is here."""
    sample = make_sample(plan.folder / "sample")
    logs = [
        Subject.of(path, plan.folder, title, last_commits=COMMITS_A_SEGMENT)
        for title, path in (("live", sample.live), ("closed", sample.closed))
    ]
    older = {path.name: path.read_bytes() for path in sample.older.glob("*.mcap")}
    yield from damage_sectors(plan, logs, older)


def damage_sectors(
    plan: Plan, logs: list[Subject], older: dict[str, bytes]
) -> Generator[Outcome, None, None]:
    """Damage sectors of logs, one way at a time, and ask what they say.

    Args:
        plan: Its seed says in which order.
        logs: Logs to damage.
        older: File name -> what the file once held.
    """
    dice = random.Random(plan.seed)
    places = [
        (log, path.name, at, way)
        for log in logs
        for path in log.files
        for at in range(0, path.stat().st_size, SECTOR)
        for way in WAYS
    ]
    dice.shuffle(places)
    for turn, (log, name, at, way) in enumerate(places):
        files = {path.name: path.read_bytes() for path in log.files}
        damaged = WAYS[way](files, older, name, at, dice)
        if damaged == files:
            continue
        changed = [other for other, data in damaged.items() if data != files[other]]
        named = name if len(changed) == 1 else ""
        may_lose = max(log.may_lose(other, damaged[other]) for other in changed)
        for other in changed:
            (log.log / other).write_bytes(damaged[other])
        what = f"{name}: sector at byte {at} {way}"
        only = log.judge.some(turn)
        judged = partial(log.judge.judge, log.log, named, may_lose=may_lose, only=only)
        yield log.outcome(plan, what, judged)
        with copy_of(log.log) as copy:
            judged = partial(log.judge.judge_appending, copy, named, may_lose=may_lose)
            yield log.outcome(plan, f"{what}, opened for appending", judged, copy)
        for other in changed:
            (log.log / other).write_bytes(files[other])


Files = dict[str, bytes]
Way = Callable[[Files, Files, str, int, random.Random], Files]


def _put(files: Files, name: str, at: int, sector: bytes) -> Files:
    """Return the files with other bytes at that place; the file keeps its length."""
    data = files[name]
    fitting = sector[: len(data) - at]
    return {**files, name: data[:at] + fitting + data[at + len(fitting) :]}


def _zeros(files: Files, _: Files, name: str, at: int, __: random.Random) -> Files:
    return _put(files, name, at, bytes(SECTOR))


def _garbage(files: Files, _: Files, name: str, at: int, dice: random.Random) -> Files:
    return _put(files, name, at, dice.randbytes(SECTOR))


def _stale(files: Files, older: Files, name: str, at: int, _: random.Random) -> Files:
    return _put(files, name, at, older[name][at : at + SECTOR].ljust(SECTOR, b"\0"))


def _doubled(files: Files, _: Files, name: str, at: int, __: random.Random) -> Files:
    sector = files[name][at : at + SECTOR]
    return _put(files, name, min(at + SECTOR, len(files[name])), sector)


def _swapped(files: Files, _: Files, name: str, at: int, dice: random.Random) -> Files:
    other = dice.randrange(len(files[name]) // SECTOR) * SECTOR
    return _exchanged(files, (name, at), (name, other))


def _swapped_between(files: Files, _: Files, name: str, at: int, dice: random.Random) -> Files:
    other = dice.choice([other for other in files if other != name])
    place = at if at + SECTOR <= len(files[other]) else len(files[other]) // SECTOR // 2 * SECTOR
    return _exchanged(files, (name, at), (other, place))


def _exchanged(files: Files, one: tuple[str, int], other: tuple[str, int]) -> Files:
    first, second = (files[name][at : at + SECTOR] for name, at in (one, other))
    size = min(len(first), len(second))
    return _put(_put(files, *one, second[:size]), *other, first[:size])


WAYS: dict[str, Way] = {
    "zeroed": _zeros,
    "full of garbage": _garbage,
    "as it once was": _stale,
    "written twice": _doubled,
    "swapped with another of the file": _swapped,
    "swapped with one of another file": _swapped_between,
}
"""In words -> what makes the damaged files from (files, older files, name, place, dice)."""
