"""Folders moved, exchanged and copied over under writers and readers, and traps planted in them."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable, Generator, Iterator
from functools import partial
from pathlib import Path

import semmap_log as sl
from fault_injection.acknowledged import Tell
from fault_injection.fault import Outcome, Plan
from fault_injection.forking import forked
from fault_injection.judging import keep
from fault_injection.moving.keeper import Box, Story, judge
from fault_injection.moving.moves import MOVES
from fault_injection.moving.traps import ACTS, names_of, trap
from fault_injection.oracle_client import Oracle
from fault_injection.pool import side_by_side
from fault_injection.sample import small_segments

USUAL = 300
COMMITS_A_SEGMENT = 4


def folders(plan: Plan) -> Generator[Outcome, None, None]:
    """Move, exchange, copy over and set traps, on all cores."""
    yield from side_by_side(_share, plan)


def _share(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    with Oracle() as oracle:
        yard = _Yard(plan, plan.folder / f"folders-{share}", oracle)
        for turn in plan.turns(USUAL, share, shares):
            yield yard.try_one(turn)


class _Yard:
    """Where one process plays."""

    def __init__(self, plan: Plan, folder: Path, oracle: Oracle) -> None:
        folder.mkdir()
        self._plan = plan
        self._folder = folder
        self._oracle = oracle
        self._log = _log_for_traps(folder / "office")
        self._names: dict[str, list[str]] = {}
        """Of each act: the names at which it can be trapped."""

    def try_one(self, turn: int) -> Outcome:
        """Do what the seed and the turn alone decide."""
        dice = random.Random(f"{self._plan.seed} {turn}")
        title, play = self._drawn(turn, dice)
        room = self._folder / "room"
        room.mkdir()
        try:
            ended = forked(partial(_play, play, room, dice))
            story = Story.of(ended.lines)
            lost, problems = judge(story, room, self._oracle)
            if ended.status:
                problems.append(f"it ended with {ended.status}: {ended.error}")
            what = " ".join([f"{turn}: {title.replace('_', ' ')}", *story.steps])
            checked = sum(len(kept.stored) for kept in story.keepers.values())
            kept = keep(room, self._plan.keep, what[:80]) if problems else None
            return Outcome(what, checked, lost, 0, "\n".join(problems), kept)
        finally:
            shutil.rmtree(room)

    def _drawn(self, turn: int, dice: random.Random) -> tuple[str, Callable[[Box], None]]:
        """Return a scenario, or a trap, and its name."""
        if turn % 2:
            scenario = MOVES[turn // 2 % len(MOVES)]
            return scenario.__name__, scenario
        act = dice.choice(list(ACTS))
        if act not in self._names:
            self._names[act] = names_of(act, self._log, self._folder)
        play = partial(trap, act=act, log=self._log, names=self._names[act])
        return f"trap for {act}", play


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
