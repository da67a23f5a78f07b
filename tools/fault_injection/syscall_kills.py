"""The process is killed before every call that changes the log's folder, or in a half of a write.

And again before the calls of the recovery that follows.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from functools import partial
from signal import SIGKILL

from fault_injection import shim
from fault_injection.fault import Outcome, Plan
from fault_injection.forking import Ended
from fault_injection.player import LEVELS, Tell, Told
from fault_injection.pool import under_shim
from fault_injection.shim import CHANGES, FOR_EVER, Action, Call
from fault_injection.story import small_limits
from fault_injection.story_bench import EMPTY, StoryBench
from fault_injection.trees import Tree, read_tree, write_tree

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
    bench = _KillBench(plan, plan.folder / f"kills_{share}", plan.seed)
    with small_limits():
        for number, kill in enumerate(bench.drawn()[share::shares]):
            yield from bench.tried(kill, whole_recovery=number % WHOLE_RECOVERY_EVERY == 0)


class _KillBench(StoryBench):
    """A story that is ended again and again."""

    def drawn(self) -> list[_Kill]:
        """Return all kills, in an order that the seed gives."""
        kills: list[_Kill] = []
        for level in LEVELS:
            calls = [entry.call for entry in self.recorded(level)]
            every = [
                _Kill(level, call, action)
                for sort, action in ((CHANGES, Action.KILL), (Call.WRITE, Action.HALF_THEN_KILL))
                for call in range(sum(made in sort for made in calls))
            ]
            share = 1 if level == "event" else SHARE_OF_OTHER_LEVELS
            kills += self.random.sample(every, int(len(every) * share))
        self.random.shuffle(kills)
        return kills

    def tried(self, kill: _Kill, *, whole_recovery: bool) -> Iterator[Outcome]:
        """Yield what became of the log, and then for kills in its recovery."""
        play = partial(self.play, level=kill.level)
        ended = self.disturbed(play, EMPTY, calls=kill.sort, action=kill.action, first=kill.call)
        fault, told, left = f"{self.name} {kill}", ended.told, read_tree(self.root)
        if ended.error:
            yield Outcome(fault, problem=ended.error)
        if ended.status != -SIGKILL:  # with threads at work, a run may have a call less
            return
        must = told.durable if kill.level == "none" else told.accepted
        outcome = self.examined(fault, left, told, must)
        yield outcome
        if outcome.is_good:
            yield from self._recoveries(fault, left, told, must, all_of_it=whole_recovery)

    def _recoveries(
        self, fault: str, left: Tree, told: Told, must: int, *, all_of_it: bool
    ) -> Iterator[Outcome]:
        """Yield what becomes of a log whose recovery is killed, too."""
        calls = self._recovered(left, told, must, FOR_EVER).seen
        for call in range(calls) if all_of_it else self.random.sample(range(calls), RECOVERY_KILLS):
            ended = self._recovered(left, told, must, call)
            again = f"{fault}, and its recovery at call {call}"
            meanwhile = Told.of([*told.lines(), *ended.lines])
            promised = max(must, meanwhile.durable)
            yield self.examined(again, read_tree(self.root), meanwhile, promised)

    def _recovered(self, left: Tree, told: Told, must: int, call: int) -> Ended:
        """Go on with what was left, in a child that is killed at that call."""
        write_tree(self.root, left)
        stored = self.examiner.stored(self.log, told, must=must)

        def go_on(tell: Tell) -> None:
            self.examiner.go_on(self.log, stored, tell)
            tell(f"seen {shim.seen()}")

        return self.disturbed(go_on, left, calls=CHANGES, action=Action.KILL, first=call)
