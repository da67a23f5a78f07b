"""Crash states of a simulated disk: what may be left when the power goes, at any call of a run.

A story is played once, its calls on the folder are recorded, and at each of them what a disk may
have kept is built as a folder, opened, checked and continued. Now and then the calls of that very
recovery are recorded, too, and crash states of it are tried in the same way.
"""

from __future__ import annotations

import hashlib
from collections.abc import Generator, Iterator
from copy import deepcopy
from dataclasses import dataclass
from itertools import islice

from fault_injection import shim
from fault_injection.disk_model import Disk
from fault_injection.fault import Outcome, Plan, Tree, read_tree, write_tree
from fault_injection.player import LEVELS, Told
from fault_injection.pool import under_shim
from fault_injection.shim import Call, Entry
from fault_injection.story import small_limits
from fault_injection.story_bench import EMPTY, StoryBench

USUAL_STATES = 10_400
STATES_PER_STORY = 1_300
FOLLOWED_SHARE = 0.03
"""Of the states, so many are followed: the calls of their recovery are recorded,"""
RECOVERY_STATES = 8
"""and so many crash states of that recovery are tried."""
KILLED_SHARE = 0.5
"""Of the followed states, so many are those of a killed process: nothing is lost by that, but
what was not synced still is not when the power goes in the recovery."""
EMPTY_PASSES = 20
"""After so many looks at a run that showed no new state, there are hardly more."""
_WITHOUT_EFFECT = Call.NOTE | Call.LOOK | Call.CLOSE


def simulated_disk(plan: Plan) -> Generator[Outcome, None, None]:
    """Yield what became of each distinct crash state."""
    yield from under_shim(_states, plan)


def _states(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    """Try every `shares`-th story, a part of the states with each."""
    wanted = plan.most(USUAL_STATES)
    per_story = min(STATES_PER_STORY, -(-wanted // len(LEVELS)))
    for number in range(share, -(-wanted // per_story), shares):
        bench = _Bench(plan, plan.seed * 1000 + number, LEVELS[number % len(LEVELS)])
        with small_limits():
            yield from islice(bench.states(per_story), per_story)


@dataclass(frozen=True, slots=True)
class _Run:
    """The calls of a run, and what was on the disk and told before it."""

    name: str
    entries: list[Entry]
    disk: Disk
    told: Told


@dataclass(frozen=True, slots=True)
class _State:
    """What a crash leaves."""

    name: str
    tree: Tree
    """As the next process finds it."""
    disk: Disk
    """As the next power cut may find it."""
    told: Told
    must: int
    """So many wishes must be there."""
    is_followed: bool

    def digest(self) -> bytes:
        """Return what tells it from others."""
        promised = (self.must, self.told.asked, self.told.exported, self.is_followed)
        return hashlib.sha256(repr((promised, self.tree)).encode()).digest()


class _Bench(StoryBench):
    """One story, and the crash states of its run."""

    def __init__(self, plan: Plan, seed: int, level: str) -> None:
        super().__init__(plan, plan.folder / f"disk_{seed}", seed, tail=6)
        self._level = level
        self._seen: set[bytes] = set()

    def states(self, wanted: int) -> Iterator[Outcome]:
        """Yield the outcomes of about so many distinct states, or of all if there are fewer."""
        run = self._played()
        tried = empty_passes = 0
        while tried < wanted and empty_passes < EMPTY_PASSES:
            empty_passes += 1
            todo = (wanted - tried) / (1 + FOLLOWED_SHARE * RECOVERY_STATES)
            for state in self._drawn(run, max(1, int(todo)), followed=FOLLOWED_SHARE):
                empty_passes = 0
                for outcome in self._tried(state):
                    yield outcome
                    tried += 1

    def _played(self) -> _Run:
        """Play the story, and return its calls."""
        entries = self.recorded(self._level)
        disk = Disk(str(self.root), EMPTY)
        for entry in entries:
            disk.take(entry)
        if disk.now() != read_tree(self.root):
            raise RuntimeError("the recorded calls do not make the folder that is there")
        return _Run(f"{self.name} ({self._level})", entries, Disk(str(self.root), EMPTY), Told())

    def _drawn(self, run: _Run, wanted: int, *, followed: float) -> Iterator[_State]:
        """Yield new states, drawn from all over a run; that share of them is to be followed."""
        places = [i for i, e in enumerate(run.entries) if e.call not in _WITHOUT_EFFECT]
        disk, lines, at = deepcopy(run.disk), run.told.lines(), 0
        for place in sorted(self.random.choices(places, k=wanted)) if places else ():
            for entry in run.entries[at : place + 1]:
                disk.take(entry)
                if entry.call == Call.NOTE:
                    lines.append(entry.data.decode())
            at = place + 1
            name = f"{run.name}, after call {place} ({run.entries[place].describe()})"
            is_followed = self.random.random() < followed
            state = self._left(name, disk, Told.of(lines), is_followed=is_followed)
            digest = state.digest()
            if digest not in self._seen:
                self._seen.add(digest)
                yield state

    def _left(self, name: str, disk: Disk, told: Told, *, is_followed: bool) -> _State:
        """Return what is left when the power goes now, or, now and then, when the process ends."""
        if is_followed and self.random.random() < KILLED_SHARE:
            must = told.durable if self._level == "none" else max(told.accepted, told.durable)
            killed = deepcopy(disk)
            killed.end_process()
            return _State(f"{name}, killed", disk.now(), killed, told, must, is_followed)
        tree = disk.crashed(self.random)
        return _State(name, tree, Disk(str(self.root), tree), told, told.durable, is_followed)

    def _tried(self, state: _State) -> Iterator[Outcome]:
        """Yield the outcome of a state, and those of power cuts while it is put in order."""
        write_tree(self.root, state.tree)
        with shim.recorded(self.root) as entries:
            outcome = self._examined(state)
        yield outcome
        if state.is_followed and outcome.is_good:
            run = _Run(f"{state.name}, then in its recovery", entries, state.disk, state.told)
            for again in self._drawn(run, RECOVERY_STATES, followed=0):
                write_tree(self.root, again.tree)
                yield self._examined(again)

    def _examined(self, state: _State) -> Outcome:
        return self.examined(state.name, state.tree, state.told, state.must, shim.note)
