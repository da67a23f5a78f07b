"""Folders moved, exchanged and copied over under writers and readers, and traps planted in them."""

from __future__ import annotations

import os
import random
import shutil
from collections.abc import Callable, Generator, Iterator
from functools import partial
from pathlib import Path

import semmap_log as sl
from fault_injection.acknowledged import Tell
from fault_injection.fault import Outcome, Plan
from fault_injection.forking import forked
from fault_injection.moving.judging import Story, judge
from fault_injection.moving.keeper import Box
from fault_injection.moving.moves import MOVES
from fault_injection.moving.traps import ACTS, names_of, trap
from fault_injection.oracle_client import Oracle
from fault_injection.pool import side_by_side
from fault_injection.sample import small_segments
from fault_injection.subject import keep

USUAL = 300
COMMITS_A_SEGMENT = 4


def folders(plan: Plan) -> Generator[Outcome, None, None]:
    """Move, exchange, copy over and set traps, on all cores."""
    yield from side_by_side(_share, plan)


def _share(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    folder = plan.folder / f"folders-{share}"
    folder.mkdir()
    log = _log_for_traps(folder / "office")
    names: dict[str, list[str]] = {}
    with Oracle() as oracle:
        for turn in plan.turns(USUAL, share, shares):
            yield _try_one(plan, turn, folder, log, names, oracle)


def _try_one(
    plan: Plan, turn: int, folder: Path, log: Path, names: dict[str, list[str]], oracle: Oracle
) -> Outcome:
    """Do what the seed and the turn alone decide."""
    dice = random.Random(f"{plan.seed} {turn}")
    if turn % 2:
        scenario = MOVES[turn // 2 % len(MOVES)]
        title, play = scenario.__name__, scenario
    else:
        act = dice.choice(list(ACTS))
        if act not in names:
            names[act] = names_of(act, log, folder)
        title, play = f"trap for {act}", partial(trap, act=act, log=log, names=names[act])
    room = folder / "room"
    room.mkdir()
    here = Path.cwd()
    try:
        ended = forked(partial(_play, play, room, dice))
        story = Story.of(ended.lines)
        lost, problems = judge(story, room, oracle)
        if ended.status:
            problems.append(f"it ended with {ended.status}: {ended.error}")
        steps = [line for line in ended.lines if line.startswith('["step"')]
        what = f"{turn}: {title.replace('_', ' ')} {' '.join(steps)}".strip()
        checked = sum(len(kept.stored) for kept in story.keepers.values())
        kept = keep(room, plan.keep, what[:80]) if problems else None
        return Outcome(what, checked, lost, 0, "\n".join(problems), kept)
    finally:
        os.chdir(here)
        shutil.rmtree(room)


def _play(play: Callable[[Box], None], room: Path, dice: random.Random, tell: Tell) -> None:
    """For a child process."""
    with small_segments(COMMITS_A_SEGMENT, chunk_bytes=2**20):
        play(Box(room, dice, tell))


def _log_for_traps(path: Path) -> Path:
    with small_segments(COMMITS_A_SEGMENT, chunk_bytes=2**20), sl.create(path, tz="UTC") as log:
        log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, name="front")
        for i in range(6):
            log.observe("front", ("open", "closed")[i % 2])
    (path / ".lock").unlink()
    return path
