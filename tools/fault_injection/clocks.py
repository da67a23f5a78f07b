"""Clocks that lie: back, frozen, years ahead, before 1970; the order of events never asks them."""

from __future__ import annotations

import random
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import semmap_log as sl
from fault_injection.fault import Outcome, Plan
from fault_injection.sample import small_segments
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model.commits import Commit
from semmap_log.store.byte_layout import KEYFRAME_CHANNEL
from semmap_log.store.reading.reader import LogReader

NOW = 1_772_400_000 * 10**9
SECOND, DAY, YEAR = 10**9, 86_400 * 10**9, 31_557_600 * 10**9
TICK = SECOND // 10
"""From one look at a clock to the next."""
Y2038, Y2262 = 2**31 * SECOND, MAX_TIME_NS - DAY
APPENDS = 24
COMMITS_A_SEGMENT = 5
RANDOM_CLOCKS = 200

Wall = Callable[[int, int], int]
"""(which look at the clock, what it should say) -> what it says, ns since 1970."""


def clocks(plan: Plan) -> Generator[Outcome, None, None]:
    """Write logs by clocks that lie in every known way, then by clocks that lie at random."""
    for name, wall in LIES.items():
        yield write_by(plan.folder / name.replace(" ", "-"), name, wall)
    dice = random.Random(plan.seed)
    for number in range(plan.most(RANDOM_CLOCKS)):
        yield write_by(plan.folder / f"random-{number}", f"at random, {number}", at_random(dice))


@dataclass
class LyingClock:
    """A machine's clock whose wall time somebody or something sets."""

    wall: Wall
    looks: int = 0
    boot_id: bytes = field(default=bytes(range(16)))

    def wall_ns(self) -> int:
        self.looks += 1
        return self.wall(self.looks, NOW + self.looks * TICK)

    def monotonic_ns(self) -> int:
        return self.looks * TICK


def write_by(path: Path, name: str, wall: Wall) -> Outcome:
    """Write a log over several segments and openings by that clock, and say what came of it."""
    clock = LyingClock(wall)
    commits = []
    with small_segments(COMMITS_A_SEGMENT):
        sl.create(path, tz="UTC", compact=False, clock=clock).close()
        for _ in range(3):
            with sl.append(path, clock=clock, compact=False) as log:
                commits += [_append(log, len(commits) + i) for i in range(APPENDS // 3)]
    lost = sum(commit not in commits for commit in sl.read(path).commits())
    return Outcome(f"clock {name}", len(commits), lost, problem="; ".join(_wrong(path, commits)))


def _append(log: sl.DoorLogWriter, turn: int) -> Commit:
    """Append something whose place in the order its values tell."""
    if turn == 0:
        log.add_door(name="front")
        return next(iter(log.commits()))
    return log.observe("front", "open" if turn % 2 else "closed", opening=turn / 100).commit


def _wrong(path: Path, commits: list[Commit]) -> Iterator[str]:
    """Yield what is not as promised."""
    log = sl.read(path)
    heads = np.concatenate([page.heads for _, page in LogReader(path).pages()])
    steps = np.diff(heads["log_time"].astype(np.int64), prepend=0)
    is_keyframe = heads["channel_id"] == KEYFRAME_CHANNEL  # has the time of the record before
    if (steps < np.where(is_keyframe, 0, 1)).any():
        yield "recorded times do not strictly increase"
    events = [event for batch in log.batches() for event in batch]
    if [event.number for event in events] != list(range(len(events))):
        yield "event numbers have gaps"
    order = [getattr(event.event, "opening", 0) for event in events[2:]]
    if order != [turn / 100 for turn in range(1, len(commits))]:
        yield "events are not in the order in which they were appended"
    for commit in commits:
        known = log.replay(known_at=commit.recorded_ns).event
        if known != commit.last_event:
            yield f"known at the commit of event {commit.last_event}: {known}"
    for batch in log.batches():
        if (batch.folds_ns > batch.recorded_ns).any():
            yield "an event folds as later than recorded"


def at_random(dice: random.Random) -> Wall:
    """Return a clock that jumps now and then, by a moment or by years."""
    steps = [dice.choice((0, 0, 0, 1, -1, SECOND, -SECOND, DAY, -DAY, YEAR, -YEAR, -60 * YEAR))
             for _ in range(20 * APPENDS)]  # fmt: skip
    return lambda look, true_ns: true_ns + sum(steps[:look])


LIES: dict[str, Wall] = {
    "tells the truth": lambda _, ns: ns,
    "goes back by a second": lambda look, ns: ns - (look > 9) * SECOND,
    "goes back by a second at each look": lambda look, ns: ns - 2 * look * SECOND,
    "goes back by two days": lambda look, ns: ns - (look > 9) * 2 * DAY,
    "goes back by two days and returns": lambda look, ns: ns - (9 < look < 20) * 2 * DAY,
    "stands still": lambda *_: NOW,
    "stands still at 0": lambda *_: 0,
    "begins in 1970": lambda look, ns: ns if look > 12 else look,
    "falls back to 1970": lambda look, ns: look if look > 12 else ns,
    "jumps to 2038": lambda look, ns: Y2038 + look if look > 12 else ns,
    "passes the end of 32 bits": lambda look, _: Y2038 + (look - 12) * SECOND,
    "jumps to 2262": lambda look, ns: Y2262 + look if look > 12 else ns,
    "jumps to 2262 and returns": lambda look, ns: Y2262 + look if 12 < look < 20 else ns,
    "says a time before 1970": lambda look, ns: -ns if look > 12 else ns,
    "begins before 1970": lambda look, ns: -look * SECOND if look < 12 else ns,
    "says less at each look, by a nanosecond": lambda look, _: NOW - look,
    "says the same twice": lambda look, _: NOW + look // 2,
    "a nanosecond before the end of time": lambda *_: MAX_TIME_NS - 1,
    "at the end of time": lambda *_: MAX_TIME_NS,
    "behind the end of time": lambda *_: MAX_TIME_NS + 1,
    "far behind the end of time": lambda *_: 2**80,
}
"""In words -> a wall clock."""
