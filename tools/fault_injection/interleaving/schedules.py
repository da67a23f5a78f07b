"""Programs run under drawn orders of their threads; each order is known by its seed."""

from __future__ import annotations

import faulthandler
import itertools
import json
import os
import random
import shutil
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path

from steady_clock import SteadyClock

import semmap_log as sl
from fault_injection.acknowledged import Said, Tell, lost_and_invented
from fault_injection.fault import Outcome, Plan
from fault_injection.forking import forked
from fault_injection.interleaving import primitives
from fault_injection.interleaving.primitives import controlled
from fault_injection.interleaving.programs import PROGRAMS, Run, play
from fault_injection.interleaving.scheduler import (
    LINE,
    Chooser,
    Parking,
    Priorities,
    RandomWalk,
    Scheduler,
    StuckError,
)
from fault_injection.judging import keep
from fault_injection.oracle_client import Oracle
from fault_injection.pool import side_by_side
from fault_injection.story import constants
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.verification.findings import EXIT_GOOD, EXIT_TORN

USUAL = 400
LONGEST_S = 60
MOST_SNAPSHOTS = 3
STEPS, STEPS_BY_LINE = 120, 1500
"""About as many as a run has: where priorities change is drawn among these."""
POINTS = {"write": 8, "write done": 8, "fdatasync": 6, "fdatasync done": 6, "fsync": 8,
          "replace": 4, "acquire": 40, "release": 40}  # fmt: skip
LINES = {LINE: 1500}
"""Where a thread may be left standing, and about how often it comes by there."""
HELD_BACK = (2**16, 1000, 600)
"""Bytes that may wait in memory: many commits, two, or one."""


def threads(plan: Plan) -> Generator[Outcome, None, None]:
    """Let threads share a log in drawn orders, at every level of durability, on all cores."""
    yield from side_by_side(_share, plan)


def _share(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    with Oracle() as oracle:
        for turn in plan.turns(USUAL, share, shares):
            dice = random.Random(f"{plan.seed} {turn}")
            yield try_schedule(plan, drawn_schedule(turn, dice), oracle)


@dataclass(frozen=True)
class Schedule:
    """One order of one program's threads."""

    turn: int
    program: str
    level: str
    seed: int

    def __str__(self) -> str:
        return f"{self.turn}: {self.program!r}, durability {self.level}, schedule {self.seed}"


_EACH = [(name, level) for name, program in PROGRAMS.items() for level in program.levels]


def drawn_schedule(turn: int, dice: random.Random) -> Schedule:
    """Return an order; each program and level has its turn."""
    name, level = _EACH[turn % len(_EACH)]
    return Schedule(turn, name, level, dice.randrange(10**9))


def try_schedule(plan: Plan, schedule: Schedule, oracle: Oracle) -> Outcome:
    """Run a program in that order, and compare what it was told with the bytes it left."""
    folder = plan.folder / f"schedule-{schedule.seed}-{os.getpid()}"
    folder.mkdir()
    try:
        ended = forked(lambda tell: _run(schedule, folder, tell))
        said = Said.of(ended.lines)
        if ended.status:
            said.problems.append(f"it ended with {ended.status}: {ended.error}")
        return _outcome(plan, schedule, folder, said, oracle)
    finally:
        shutil.rmtree(folder)


def _outcome(plan: Plan, schedule: Schedule, folder: Path, said: Said, oracle: Oracle) -> Outcome:
    problems = list(said.problems)
    log = folder / "log"
    promised = set(said.accepted) if said.closed else said.durable
    found = oracle.ask(log)
    lost, invented, problem = lost_and_invented(said, found, promised)
    problems += [problem] if problem else []
    poses = [e["x"] for e in found["events"] if e["kind"] == "RobotPose"]
    if said.closed and not problems and sorted(poses) != sorted(said.poses):
        problems.append(f"{len(said.poses)} poses were given, {len(poses)} are there")
    for snapshot, durable in said.snapshots:
        gone, more, problem = lost_and_invented(said, oracle.ask(snapshot), durable)
        if gone or more or problem:
            problems.append(f"after a power cut ({snapshot.name}): {problem}")
            lost, invented = max(lost, gone), max(invented, more)
    if not problems and not lost:
        problems += _findings(log, is_closed=said.closed)
    what = str(schedule)
    kept = keep(folder, plan.keep, what) if problems or lost or invented else None
    return Outcome(what, len(promised), lost, invented, "\n".join(problems), kept)


def _run(schedule: Schedule, folder: Path, tell: Tell) -> None:
    """Play the program; for a child process."""
    faulthandler.dump_traceback_later(LONGEST_S + 20, exit=True)
    dice = random.Random(schedule.seed)
    program = PROGRAMS[schedule.program]
    by_line = dice.random() < 0.5
    scheduler = Scheduler(_chooser(dice, by_line=by_line))
    synced: dict[int, int] = {}

    def note_sync(fd: int) -> None:
        status = os.fstat(fd)
        synced[status.st_ino] = status.st_size

    chunk_bytes = dice.choice((400, 2**20))
    keyframes = {"KEYFRAME_EVERY_BYTES": 2 * chunk_bytes, "KEYFRAME_RARITY": 0}
    with (
        constants(
            ROLL_COMMITS=program.roll,
            CHUNK_BYTES=chunk_bytes,
            MOST_HELD_BACK_BYTES=dice.choice(HELD_BACK),
            **keyframes,
        ),
        controlled(scheduler, by_line=by_line, synced=note_sync) as trace,
    ):

        def main() -> None:
            run = _begun(schedule, folder, dice, tell, synced)
            thread = primitives.controlled_threading(scheduler, trace).Thread
            play(program, run, thread, trace)

        try:
            scheduler.run(main, LONGEST_S)
        except StuckError as error:
            tell(json.dumps(["stuck", str(error)]))


def _begun(
    schedule: Schedule, folder: Path, dice: random.Random, tell: Tell, synced: dict[int, int]
) -> Run:
    path = folder / "log"
    log = sl.create(
        path,
        tz="UTC",
        durability=schedule.level,
        batch_events=3,
        batch_s=0.01,
        compact=PROGRAMS[schedule.program].compact,
        clock=SteadyClock(),
        entropy=random.Random(schedule.seed).randbytes,
    )
    log.add_door()
    numbers = itertools.count()
    chance = dice.random()

    def snapshot() -> Path | None:
        if dice.random() > chance or (number := next(numbers)) >= MOST_SNAPSHOTS:
            return None
        return _as_after_a_power_cut(path, folder / f"snapshot-{number}", synced)

    return Run(path, log, schedule.level, dice, tell, snapshot)


def _as_after_a_power_cut(log: Path, to: Path, synced: dict[int, int]) -> Path:
    """Copy a log as far as it was synced; names are taken for synced, too."""
    to.mkdir()
    for path in log.glob("*.mcap"):
        size = synced.get(path.stat().st_ino, 0)
        (to / path.name).write_bytes(path.read_bytes()[:size])
    return to


def _chooser(dice: random.Random, *, by_line: bool) -> Chooser:
    way = dice.random()
    if way < 0.2:
        return RandomWalk(dice)
    if way < 0.4:
        return Priorities(dice, steps=STEPS_BY_LINE if by_line else STEPS)
    return Parking(dice, {**POINTS, **LINES} if by_line else POINTS)


def _findings(log: Path, *, is_closed: bool) -> list[str]:
    """Return what `verify` has against a log; a torn tail only counts if it was closed."""
    try:
        found = verify(log)
    except Exception as error:  # noqa: BLE001 - whatever it is, it is the finding
        return [f"verify: {error!r}"]
    if found.exit_code == EXIT_GOOD or (found.exit_code == EXIT_TORN and not is_closed):
        return []
    return [f"verify: {[finding.text for finding in found.findings]}"]
