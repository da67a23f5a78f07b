"""The n-th write, sync, rename, opening … fails, once or for ever, as bad and full disks do.

The same process goes on: it is told, opens the log again, and sends its command once more. Short
writes and interrupted calls must not even be noticed.
"""

from __future__ import annotations

import errno
from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from functools import partial

from fault_injection.fault import Outcome, Plan
from fault_injection.forking import Ended
from fault_injection.player import LEVELS
from fault_injection.pool import under_shim
from fault_injection.shim import FOR_EVER, Action, Call
from fault_injection.story import small_limits
from fault_injection.story_bench import EMPTY, StoryBench
from fault_injection.stubborn import StubbornPlayer
from fault_injection.trees import keep, read_tree

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
