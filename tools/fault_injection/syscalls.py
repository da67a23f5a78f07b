"""A process killed, or failed by the kernel, at each call that changes the log's folder.

And again before the calls of the recovery that follows.

The same process goes on: it is told, opens the log again, and sends its command once more. Short
writes and interrupted calls must not even be noticed.
"""

from __future__ import annotations

import errno
from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from functools import partial
from signal import SIGKILL

from fault_injection import shim
from fault_injection.fault import Outcome, Plan, Tree, keep, read_tree, write_tree
from fault_injection.forking import Ended
from fault_injection.player import LEVELS, StubbornPlayer, Tell, Told
from fault_injection.pool import under_shim
from fault_injection.shim import CHANGES, FOR_EVER, Action, Call
from fault_injection.story import small_limits
from fault_injection.story_bench import EMPTY, StoryBench

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

        def proceed(tell: Tell) -> None:
            self.examiner.proceed(self.log, stored, tell)
            tell(f"seen {shim.seen()}")

        return self.disturbed(proceed, left, calls=CHANGES, action=Action.KILL, first=call)


SYNCS = Call.FSYNC | Call.FDATASYNC
USUAL_FAULTS = 1_000


@dataclass(frozen=True, slots=True)
class _Way:
    """How a sort of call fails."""

    calls: Call
    action: Action
    error: int = 0
    is_told: bool | None = None
    """Whether the program is told of it: it must not, it must; None: a background thread, or a
    part that is not needed, may be all that failed."""
    is_sampled: bool = True
    """Whether some calls will do; else each of them fails in turn, at the level `event`."""

    def __str__(self) -> str:
        half = {Action.HALF_THEN_FAIL: "half of ", Action.SHORT: "short "}.get(self.action, "")
        return f"{half}{self.calls.name} {errno.errorcode.get(self.error, '')}".strip()


WAYS = (
    _Way(Call.WRITE, Action.FAIL, errno.EIO),
    _Way(Call.WRITE, Action.FAIL, errno.ENOSPC),
    _Way(Call.WRITE, Action.HALF_THEN_FAIL, errno.ENOSPC, is_sampled=False),
    _Way(Call.FDATASYNC, Action.FAIL, errno.EIO, is_told=True, is_sampled=False),
    _Way(Call.FSYNC, Action.FAIL, errno.EIO, is_sampled=False),
    _Way(Call.FSYNC, Action.FAIL, errno.ENOSPC),
    _Way(Call.RENAME, Action.FAIL, errno.EIO, is_sampled=False),
    _Way(Call.OPEN, Action.FAIL, errno.EMFILE),
    _Way(Call.OPEN, Action.FAIL, errno.EROFS),
    _Way(Call.LOOK, Action.FAIL, errno.EMFILE),
    _Way(Call.LOOK, Action.FAIL, errno.EIO),
    _Way(Call.UNLINK, Action.FAIL, errno.EIO),
    _Way(Call.TRUNCATE, Action.FAIL, errno.EIO),
    _Way(Call.MKDIR, Action.FAIL, errno.ENOSPC),
    _Way(Call.WRITE, Action.SHORT, is_told=False),
    _Way(Call.WRITE | SYNCS | Call.OPEN | Call.LOOK, Action.FAIL, errno.EINTR, is_told=False),
)


def syscall_errors(plan: Plan) -> Generator[Outcome, None, None]:
    """Yield what became of the log for each call that failed."""
    yield from under_shim(_errors, plan)


@dataclass(frozen=True, slots=True)
class _Fault:
    """Which calls of a run fail, and how."""

    level: str
    way: _Way
    first: int
    """The call from which on they fail, counted from 0 among those of its sort."""
    count: int

    def __str__(self) -> str:
        lasting = " and all that follow" if self.count == FOR_EVER else ""
        return f"({self.level}) {self.way} at call {self.first}{lasting}"


def _can_be_left_out(fault: _Fault) -> bool:
    return fault.way.is_sampled or fault.level != "event" or fault.count == FOR_EVER


def _errors(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    bench = _ErrorBench(plan, plan.folder / f"errors_{share}", plan.seed)
    with small_limits():
        for fault in bench.drawn()[share::shares]:
            yield bench.tried(fault)


class _ErrorBench(StoryBench):
    """A story in which calls fail, played by one who does not give up."""

    player = StubbornPlayer

    def drawn(self) -> list[_Fault]:
        """Return the faults to try: all that are not to be sampled, and some of the others."""
        every = [fault for level in LEVELS for fault in self._faults(level)]
        self.random.shuffle(every)
        chosen = sorted(every, key=_can_be_left_out)[:USUAL_FAULTS]
        self.random.shuffle(chosen)
        return chosen

    def _faults(self, level: str) -> Iterator[_Fault]:
        entries = self.recorded(level)
        assert entries[-1].data.decode() == "finished", "the story cannot be told"
        calls = [entry.call for entry in entries]
        for way in WAYS:
            for first in range(sum(call in way.calls for call in calls)):
                yield _Fault(level, way, first, 1)
                if way.error != errno.EINTR and first % 3 == 0:
                    yield _Fault(level, way, first, FOR_EVER)

    def tried(self, fault: _Fault) -> Outcome:
        """Return what became of the log."""
        name, way = f"{self.name} {fault}", fault.way
        play = partial(self.play, level=fault.level)
        ended = self.disturbed(
            play, EMPTY, calls=way.calls, action=way.action, first=fault.first, count=fault.count,
            error=way.error,
        )  # fmt: skip
        left = read_tree(self.root)
        outcome = self._outcome(name, fault, ended)
        return outcome if outcome.is_good else replace(
            outcome, kept=keep(self.plan.keep, name, left)
        )  # fmt: skip

    def _outcome(self, name: str, fault: _Fault, ended: Ended) -> Outcome:
        broken = [line for line in ended.lines if line.startswith("broken")]
        failures = [line for line in ended.lines if line.startswith("failure ")]
        finished = "finished" in ended.lines
        if ended.error or broken:
            return Outcome(name, problem=ended.error or "; ".join(broken))
        if ended.status:
            return Outcome(name, problem=f"the process ended with {ended.status}: {failures}")
        if failures and fault.way.is_told is False:
            return Outcome(name, problem=f"it should not even notice: {failures}")
        if fault.way.is_told and not failures:
            return Outcome(name, problem="it failed, and the program was not told")
        if not finished and fault.count != FOR_EVER:
            return Outcome(name, problem=f"one call failed, and the run ended: {failures}")
        told = ended.told
        must = told.durable if fault.level == "none" else told.accepted
        return self.examiner.examine(name, self.log, told, must=must)
