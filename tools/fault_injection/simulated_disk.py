"""Crash states of a simulated disk: what may be left when the power goes, at any call of a run.

A story is played once, its calls on the folder are recorded, and at each of them what a disk may
have kept is built as a folder, opened, checked and continued. Now and then the calls of that very
recovery are recorded, too, and crash states of it are tried in the same way.
"""

from __future__ import annotations

import hashlib
from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from random import Random

from fault_injection import shim
from fault_injection.disk_model import Disk
from fault_injection.examiner import Examiner
from fault_injection.fault import Outcome, Plan
from fault_injection.player import LEVELS, Player, Told
from fault_injection.shim import Call, Entry
from fault_injection.story import small_limits, story
from fault_injection.trees import Tree, keep, read_tree, write_tree
from fault_injection.workers import shared

USUAL_STATES = 10_000
STATES_PER_STORY = 1_250
RECOVERY_EVERY = 50
"""Of so many states, one has the calls of its recovery recorded,"""
RECOVERY_STATES = 10
"""and so many crash states of that recovery are tried."""
EMPTY_PASSES = 20
"""After so many looks at a run that showed no new state, there are hardly more."""
_PER_RECOVERY = RECOVERY_EVERY + RECOVERY_STATES
_NOTE_AND_LOOK = Call.NOTE | Call.LOOK | Call.CLOSE


def simulated_disk(plan: Plan) -> Generator[Outcome, None, None]:
    """Yield what became of each distinct crash state."""
    yield from shared(_states, plan)


def _states(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    """Try every `shares`-th story, a part of the states with each."""
    wanted = plan.most(USUAL_STATES)
    per_story = min(STATES_PER_STORY, -(-wanted // len(LEVELS)))
    for number in range(share, -(-wanted // per_story), shares):
        bench = _Bench(plan, plan.seed * 1000 + number, LEVELS[number % len(LEVELS)])
        with small_limits():
            yield from bench.states(per_story)


@dataclass(frozen=True, slots=True)
class _Run:
    """The calls of a run, and what was on the disk and told before it."""

    name: str
    entries: list[Entry]
    before: Tree
    told: Told


@dataclass(frozen=True, slots=True)
class _State:
    """What a crash may leave."""

    name: str
    tree: Tree
    told: Told

    def digest(self) -> bytes:
        """Return what tells it from others."""
        promised = (self.told.asked, self.told.durable, self.told.exported)
        return hashlib.sha256(repr((promised, self.tree)).encode()).digest()


class _Bench:
    """One story, and the crash states of its run."""

    def __init__(self, plan: Plan, seed: int, level: str) -> None:
        self._plan = plan
        self._story = story(seed)
        self._level = level
        self._name = f"story {seed} ({level})"
        self._examiner = Examiner(self._story)
        self._root = plan.folder / f"disk_{seed}"
        self._random = Random(seed)
        self._seen: set[bytes] = set()

    def states(self, wanted: int) -> Iterator[Outcome]:
        """Yield the outcomes of so many distinct states, or of all if there are fewer."""
        run = self._played()
        tried = empty_passes = 0
        while tried < wanted and empty_passes < EMPTY_PASSES:
            # Some of the outcomes come from recoveries; a pass must not end before the run does.
            todo = max(1, (wanted - tried) * RECOVERY_EVERY // _PER_RECOVERY)
            empty_passes += 1
            for number, state in enumerate(self._drawn(run, todo), start=1):
                empty_passes = 0
                for outcome in self._tried(state, with_recovery=number % RECOVERY_EVERY == 0):
                    yield outcome
                    tried += 1
                    if tried == wanted:
                        return

    def _played(self) -> _Run:
        """Play the story, and return its calls."""
        before: Tree = {"out": {}}
        write_tree(self._root, before)
        with shim.recorded(self._root) as entries:
            Player(self._root / "log", self._story, shim.note, self._level).play()
        run = _Run(self._name, entries, before, Told())
        self._check_model(run)
        return run

    def _check_model(self, run: _Run) -> None:
        """Stop if the recorded calls do not make the folder that is there."""
        disk = Disk(str(self._root), run.before)
        for entry in run.entries:
            disk.take(entry)
        if disk.now() != read_tree(self._root):
            raise RuntimeError("the recorded calls do not make the folder that is there")

    def _drawn(self, run: _Run, wanted: int) -> Iterator[_State]:
        """Yield new states, drawn from all over a run."""
        places = [i for i, entry in enumerate(run.entries) if entry.call not in _NOTE_AND_LOOK]
        chosen = sorted(self._random.choices(places, k=wanted))
        disk, lines, at = Disk(str(self._root), run.before), run.told.lines(), 0
        for place in chosen:
            while at <= place:
                entry = run.entries[at]
                disk.take(entry)
                if entry.call == Call.NOTE:
                    lines.append(entry.data.decode())
                at += 1
            # What is told right behind a call was told before the next: both are tried.
            name = f"{run.name}, after call {place} ({run.entries[place].describe()})"
            state = _State(name, disk.crashed(self._random), Told.of(lines))
            digest = state.digest()
            if digest not in self._seen:
                self._seen.add(digest)
                yield state

    def _tried(self, state: _State, *, with_recovery: bool) -> Iterator[Outcome]:
        """Yield the outcome of a state, and those of crashes while it is put in order."""
        write_tree(self._root, state.tree)
        with shim.recorded(self._root) as entries:
            outcome = self._examined(state)
        yield outcome
        if with_recovery and outcome.is_good:
            recovery = _Run(f"{state.name}, and in its recovery", entries, state.tree, state.told)
            for again in self._drawn(recovery, RECOVERY_STATES):
                write_tree(self._root, again.tree)
                yield self._examined(again)

    def _examined(self, state: _State) -> Outcome:
        log = self._root / "log"
        outcome = self._examiner.examine(
            state.name, log, state.told, must=state.told.durable, tell=shim.note
        )
        if outcome.is_good:
            return outcome
        return replace(outcome, kept=keep(self._plan.keep, state.name, state.tree))
