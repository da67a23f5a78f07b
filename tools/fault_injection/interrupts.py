"""Ctrl-C at any step that a writer takes, no stack left, and events that cannot be had.

After each: what was acknowledged is stored, nothing is there by half or twice, and the writer
either goes on rightly or refuses to.
"""

from __future__ import annotations

import linecache
import random
import shutil
import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

import semmap_log as sl
from fault_injection.fault import Outcome, Plan
from fault_injection.ledger import Ledger
from fault_injection.sample import small_segments
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, RobotPose
from semmap_log.errors import LogError, LogPoisonedError, SemmapError

COMMITS_A_SEGMENT = 4
STEPS = 3000
PACKAGE = str(Path(sl.__file__).parent)
MOST_ROOM = 150
"""With so many calls left on the stack, an append goes through."""


def interrupts(plan: Plan) -> Generator[Outcome, None, None]:
    """Interrupt a writer at steps drawn from all that it takes; then the rest."""
    yield from interrupt_anywhere(plan.folder, plan.seed, plan.most(STEPS))
    yield from exhaust_the_stack(plan.folder / "stack")
    yield from spoil_the_events(plan.folder / "spoilt")


class Interrupter:
    """Raises at the n-th step that the package takes: a line of it, entered or returned to."""

    def __init__(self, step: int, error: type[BaseException] = KeyboardInterrupt) -> None:
        self.step = step
        self.steps = 0
        self.place = ""
        self._error = error

    def __enter__(self) -> None:
        self._before = sys.gettrace()  # whoever measures coverage goes on afterwards
        sys.settrace(self._trace)

    def __exit__(self, *_: object) -> None:
        sys.settrace(self._before)

    def _trace(self, frame: FrameType, event: str, _: object) -> Any:
        code = frame.f_code
        if not code.co_filename.startswith(PACKAGE):
            return None
        if event == "return" or (event == "line" and not _is_with(frame)):
            self.steps += 1
            if self.steps == self.step:
                self.place = f"{Path(code.co_filename).name}:{frame.f_lineno} {code.co_name}"
                raise self._error
        return self._trace


def _is_with(frame: FrameType) -> bool:
    """Tell whether a step is a `with`, which is traced again on the way out of its block.

    What is raised there would leave a lock held. No signal can do that: the interpreter looks for
    one when calls return, and a lock's `__exit__` has then let go.
    """
    line = linecache.getline(frame.f_code.co_filename, frame.f_lineno)
    return line.lstrip().startswith("with ")


Story = Callable[[Ledger, sl.DoorLogWriter], None]


def _one_door(ledger: Ledger, log: sl.DoorLogWriter) -> None:
    ledger.add_doors(log)


def _doors_and_poses(ledger: Ledger, log: sl.DoorLogWriter) -> None:
    log.robot_pose(RobotPose(x=float(len(ledger.acknowledged)), y=0.0, theta=0.0))
    ledger.add_doors(log, 8)


def _own_door(ledger: Ledger, log: sl.DoorLogWriter) -> None:
    """Let the log choose the id: it must never choose one twice."""
    following = max([*ledger.acknowledged.values(), *ledger.tried], default=0) + 1
    ledger.note("tried", -1, following)
    door = log.add_door(name=f"door {following}")
    *_, added = log.history(door, kinds=[DoorAdded])
    ledger.note("stored", added.number, door)


STORIES: dict[str, Story] = {
    "a door": _one_door,
    "doors in several chunks behind a pose": _doors_and_poses,
    "a door whose id the log gives": _own_door,
}
"""In words -> what is done while it is interrupted."""


def interrupt_anywhere(folder: Path, seed: int, times: int) -> Iterator[Outcome]:
    """Interrupt commands at steps drawn from all that they take, rolling included."""
    dice = random.Random(seed)
    situations = [(story, before) for story in STORIES for before in (1, COMMITS_A_SEGMENT)]
    steps = {of: _interrupt(folder / "all", *of, sys.maxsize)[1] for of in situations}
    for _ in range(times):
        story, before = of = dice.choice(situations)
        step = dice.randint(1, steps[of])
        yield _interrupt(folder / f"{before}-{step}", story, before, step)[0]


def _interrupt(path: Path, story: str, before: int, step: int) -> tuple[Outcome, int]:
    """Interrupt a command at a step, go on, and return what came of it, and the steps taken.

    Args:
        path: Where the log is made; it is removed afterwards.
        story: Which command.
        before: How many commits the log has; with `COMMITS_A_SEGMENT`, the segment is full.
        step: Which step; one beyond the last interrupts nothing.
    """
    ledger, interrupter = Ledger(), Interrupter(step)
    with small_segments(COMMITS_A_SEGMENT, chunk_bytes=300):
        log = sl.create(path, tz="UTC", compact=False)
        for _ in range(before):
            ledger.add_doors(log)
        with suppress(BaseException), interrupter:  # what is raised may become another error
            STORIES[story](ledger, log)
        _continue(ledger, log)
        what = f"interrupted at step {step} of {story}, {interrupter.place}"
        outcome = ledger.outcome(path, what)
    shutil.rmtree(path)
    return outcome, interrupter.steps


def _continue(ledger: Ledger, log: sl.DoorLogWriter) -> None:
    """Do what a program does that caught an error: the next command, then close."""
    for call in (partial(_own_door, ledger, log), partial(ledger.add_doors, log), log.close):
        with suppress(LogError):
            call()


def exhaust_the_stack(folder: Path, *, every: int = 1) -> Iterator[Outcome]:
    """Append with less and less of the stack left, until there is enough."""
    for room in range(1, MOST_ROOM, every):
        path = folder / f"log-{room}"
        ledger = Ledger()
        log = sl.create(path, tz="UTC", compact=False)
        ledger.add_doors(log)
        with suppress(RecursionError, SemmapError):
            _deep(sys.getrecursionlimit() - room - _depth(), partial(ledger.add_doors, log))
        _continue(ledger, log)
        yield ledger.outcome(path, f"append with room for {room} calls on the stack")
        shutil.rmtree(path)


def _deep(levels: int, call: Callable[[], None]) -> None:
    if levels <= 0:
        call()
    else:
        _deep(levels - 1, call)


def _depth() -> int:
    frame: FrameType | None = sys._getframe()  # noqa: SLF001
    depth = 0
    while frame:
        frame, depth = frame.f_back, depth + 1
    return depth


def spoil_the_events(folder: Path) -> Iterator[Outcome]:
    """Append from iterators that fail after so many events, in every way they can."""
    errors = (ValueError, OSError, MemoryError, KeyboardInterrupt, RecursionError, GeneratorExit)
    with small_segments(COMMITS_A_SEGMENT, chunk_bytes=300):
        for error in errors:
            for good in range(12):
                path = folder / f"{error.__name__}-{good}"
                ledger = Ledger()
                log = sl.create(path, tz="UTC", compact=False)
                ledger.add_doors(log)
                with suppress(LogPoisonedError, error):
                    log.append(_spoilt(good, error))
                _continue(ledger, log)
                yield ledger.outcome(path, f"{error.__name__} in the events, behind {good} of them")
                shutil.rmtree(path)


def _spoilt(good: int, error: type[BaseException]) -> Iterator[DoorAdded]:
    for door in range(good):
        yield DoorAdded(door_id=DoorId(100_000 + door))
    raise error
