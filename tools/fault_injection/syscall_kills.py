"""The process is killed before every call that changes the log's folder, or in a half of a write.

And again before the calls of the recovery that follows.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from signal import SIGKILL

from fault_injection import shim
from fault_injection.examiner import Examiner
from fault_injection.fault import Outcome, Plan
from fault_injection.forking import Ended, forked
from fault_injection.player import LEVELS, Player, Tell, Told
from fault_injection.pool import under_shim
from fault_injection.shim import CHANGES, FOR_EVER, Action, Call
from fault_injection.story import small_limits, story
from fault_injection.trees import Tree, keep, read_tree, write_tree

EMPTY: Tree = {"out": {}}
SHARE_OF_OTHER_LEVELS = 0.1
"""At the level `event` every call is tried, at the others so many of them."""
RECOVERY_KILLS = 1
"""So many calls of each recovery are tried,"""
WHOLE_RECOVERY_EVERY = 150
"""and all of them for one recovery in so many."""


def syscall_kills(plan: Plan) -> Generator[Outcome, None, None]:
    """Yield what became of the log for each call at which the writer was killed."""
    yield from under_shim(_kills, plan)


@dataclass(frozen=True, slots=True)
class _Kill:
    """Where a run is ended."""

    level: str
    call: int
    """Counted from 0, among those of its sort."""
    action: Action

    @property
    def sort(self) -> Call:
        """Among which calls it is counted."""
        return CHANGES if self.action == Action.KILL else Call.WRITE

    def __str__(self) -> str:
        what = "call" if self.action == Action.KILL else "half of write"
        return f"({self.level}) killed at {what} {self.call}"


def _kills(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    bench = _Bench(plan, plan.folder / f"kills_{share}")
    with small_limits():
        for number, kill in enumerate(bench.drawn()[share::shares]):
            yield from bench.tried(kill, whole_recovery=number % WHOLE_RECOVERY_EVERY == 0)


class _Bench:
    """A story that is ended again and again."""

    def __init__(self, plan: Plan, root: Path) -> None:
        self._plan = plan
        self._root = root
        self._story = story(plan.seed)
        self._examiner = Examiner(self._story)
        self._random = Random(plan.seed)

    def drawn(self) -> list[_Kill]:
        """Return all kills, in an order that the seed gives."""
        kills: list[_Kill] = []
        for level in LEVELS:
            calls = self._calls(level)
            every = [
                _Kill(level, call, action)
                for sort, action in ((CHANGES, Action.KILL), (Call.WRITE, Action.HALF_THEN_KILL))
                for call in range(sum(made in sort for made in calls))
            ]
            share = 1 if level == "event" else SHARE_OF_OTHER_LEVELS
            kills += self._random.sample(every, int(len(every) * share))
        self._random.shuffle(kills)
        return kills

    def tried(self, kill: _Kill, *, whole_recovery: bool) -> Iterator[Outcome]:
        """Yield what became of the log, and then for kills in its recovery."""
        ended = self._played(kill.level, kill.sort, kill.action, kill.call)
        fault, told, left = f"story {self._plan.seed} {kill}", ended.told, read_tree(self._root)
        if ended.error:
            yield Outcome(fault, problem=ended.error)
        if ended.status != -SIGKILL:  # with threads at work, a run may have a call less
            return
        must = told.durable if kill.level == "none" else told.accepted
        outcome = self._examined(fault, left, told, must)
        yield outcome
        if outcome.is_good:
            yield from self._recoveries(fault, left, told, must, all_of_it=whole_recovery)

    def _recoveries(
        self, fault: str, left: Tree, told: Told, must: int, *, all_of_it: bool
    ) -> Iterator[Outcome]:
        """Yield what becomes of a log whose recovery is killed, too."""
        calls = self._recovered(left, told, must, FOR_EVER).seen
        for call in (
            range(calls) if all_of_it else self._random.sample(range(calls), RECOVERY_KILLS)
        ):
            ended = self._recovered(left, told, must, call)
            again = f"{fault}, and its recovery at call {call}"
            meanwhile = Told.of([*told.lines(), *ended.lines])
            yield self._examined(
                again, read_tree(self._root), meanwhile, max(must, meanwhile.durable)
            )

    def _calls(self, level: str) -> list[Call]:
        """Return the calls of a run that nothing disturbs."""
        write_tree(self._root, EMPTY)
        with shim.recorded(self._root) as entries:
            Player(self._root / "log", self._story, shim.note, level).play()
        return [entry.call for entry in entries]

    def _played(self, level: str, sort: Call, action: Action, call: int) -> Ended:
        """Play the story in a child that is ended at that call."""

        def play(tell: Tell) -> None:
            shim.watch(self._root)
            shim.arm(sort, action, call)
            Player(self._root / "log", self._story, tell, level).play()

        write_tree(self._root, EMPTY)
        return forked(play)

    def _recovered(self, left: Tree, told: Told, must: int, call: int) -> Ended:
        """Go on with what was left, in a child that is killed at that call."""
        log = self._root / "log"

        def go_on(tell: Tell) -> None:
            shim.watch(self._root)
            shim.arm(CHANGES, Action.KILL, call)
            self._examiner.go_on(log, stored, tell)
            tell(f"seen {shim.seen()}")

        write_tree(self._root, left)
        stored = self._examiner.stored(log, told, must=must)
        return forked(go_on)

    def _examined(self, fault: str, left: Tree, told: Told, must: int) -> Outcome:
        outcome = self._examiner.examine(fault, self._root / "log", told, must=must)
        if outcome.is_good:
            return outcome
        return replace(outcome, kept=keep(self._plan.keep, fault, left))
