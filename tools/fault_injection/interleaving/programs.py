"""Small programs of two or three threads that use one log, and note what they were told."""

from __future__ import annotations

import json
import random
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import semmap_log as sl
from fault_injection.acknowledged import Tell, digest
from semmap_log.core.model.events import DoorAnnotated, RobotPose
from semmap_log.errors import LogError
from semmap_log.log.door_log.door_log_writer import DoorLogWriter

SHORT, LONG = 10, 60_000
"""Lengths of texts; the long ones fill what durability `none` holds back."""
LONG_CHANCE = 0.2

Snapshot = Callable[[], Path | None]
"""Copies the log as a power cut would leave it now."""


@dataclass
class Run:
    """One run of a program: its log, and where it notes what it is told."""

    path: Path
    log: DoorLogWriter
    level: str
    dice: random.Random
    tell: Tell
    snapshot: Snapshot
    each: int = 5
    """How many annotations a thread makes."""
    is_closing: bool = False
    _numbers: dict[str, Any] = field(default_factory=dict)

    def say(self, word: str, *values: object) -> None:
        """Note something."""
        self.tell(json.dumps([word, *values]))

    def annotate(self, thread: str, **about: Any) -> tuple[str, Any]:
        """Make one annotation of a text of its own; return its key, and what was answered."""
        number = next(self._numbers.setdefault(thread, count()))
        key = f"{thread}/{number}"
        size = LONG if self.dice.random() < LONG_CHANCE else SHORT
        text = f"{key} ".ljust(size, "x")
        self.say("tried", key)
        appended = self.log.annotate(1, key, text, **about)
        self.say("accepted", key, appended.first_event, digest(text))
        if self.level == "event":
            self.promised([key])
        return key, appended

    def promised(self, keys: list[str]) -> None:
        """Note what the log says is durable now, and keep what a power cut would leave."""
        for key in keys:
            self.say("durable", key)
        kept = self.snapshot()
        if kept is not None:
            self.say("snapshot", str(kept))


Body = Callable[[Run], None]


def appender(name: str, *, wait_every: int = 2) -> Body:
    """Return a thread that annotates, and waits at every so-many-th."""

    def body(run: Run) -> None:
        for i in range(run.each):
            key, appended = run.annotate(name)
            if (i + 1) % wait_every == 0:
                appended.wait()
                run.promised([key])

    return body


def syncer(run: Run) -> None:
    """Annotate, and sync all."""
    mine = []
    for i in range(run.each):
        mine.append(run.annotate("syncer")[0])
        if i % 2:
            run.log.sync()
            run.promised(mine)


def poller(run: Run) -> None:
    """Ask the writer's own log for its doors: it hands the kernel what it holds back."""
    for _ in range(run.each):
        _check_numbers(run, "the writer's own reader", run.log)


def refresher(run: Run) -> None:
    """Open the log's files, and refresh."""
    opened = sl.read(run.path)
    for _ in range(run.each):
        opened.refresh()
        _check_numbers(run, "a reader", opened)


def follower(run: Run) -> None:
    """Follow the log for some looks."""
    looks = count()
    numbers = count()
    for followed in sl.read(run.path).follow(-1, stop=lambda: next(looks) >= run.each):
        for recorded in followed:
            if recorded.number != next(numbers):
                run.say("wrong", "follow", recorded.number)
                return


def poser(run: Run) -> None:
    """Say where the robot is: joins the next commit, or comes by a timer."""
    for i in range(run.each):
        x = float(run.dice.randrange(10**9))
        run.log.robot_pose(RobotPose(x=x, y=float(i), theta=0.0))
        run.say("pose", x)


def closer(run: Run) -> None:
    """Close the log while others use it."""
    run.annotate("closer")
    run.is_closing = True
    run.log.close()
    run.say("closed")


def same_command(name: str) -> Body:
    """Return a thread that sends the commands that its twin sends, too: each is stored once."""

    def body(run: Run) -> None:
        for i in range(run.each):
            key, command = f"command/{i}", bytes([i + 1]) * 16
            run.say("tried", key)
            text = f"{key} ".ljust(LONG if i % 2 else SHORT, "x")
            event = DoorAnnotated(door_id=1, key=key, value=text)  # type: ignore[arg-type]
            appended = run.log.append([event], command_id=command)
            run.say("accepted", key, appended.first_event, digest(text))
            if name == "waits":
                appended.wait()
                run.promised([key])

    return body


def _check_numbers(run: Run, who: str, log: sl.DoorLog) -> None:
    numbers = [n for batch in log.batches() for n in batch.number.tolist()]
    if numbers != list(range(len(numbers))):
        run.say("wrong", f"{who} saw events {numbers}")


@dataclass(frozen=True)
class Program:
    """What runs side by side, and on which log."""

    bodies: tuple[Body, ...]
    roll: int = 10_000
    """Commits a segment."""
    compact: bool = False
    levels: tuple[str, ...] = ("none", "event", "batch", "flush")


PROGRAMS: dict[str, Program] = {
    "append and wait": Program((appender("a", wait_every=1), appender("b"))),
    "append a lot, and wait": Program((appender("a", wait_every=1), appender("b", wait_every=9))),
    "append and sync": Program((appender("a", wait_every=9), syncer)),
    "append and its own reader": Program((appender("a", wait_every=3), poller)),
    "append and roll": Program((appender("a"), appender("b", wait_every=1)), roll=3),
    "three that append": Program((appender("a"), appender("b"), syncer), roll=5),
    "close and wait": Program((appender("a", wait_every=1), closer)),
    "close, roll and poses": Program((appender("a"), poser, closer), roll=2),
    "timers and append": Program((appender("a", wait_every=9), poser)),
    "timers, reader and roll": Program((poser, poller, appender("b")), roll=3),
    "compaction, reader and append": Program(
        (appender("a"), refresher, appender("b")), roll=2, compact=True
    ),
    "compaction, own reader and close": Program((appender("a"), poller), roll=2, compact=True),
    "follow and roll": Program((appender("a"), follower), roll=2, compact=True),
    "one command twice": Program((same_command("waits"), same_command("goes on")), roll=3),
    "one command twice, and read": Program((same_command("waits"), poller, same_command("on"))),
}


def play(program: Program, run: Run, thread: Callable[..., Any], trace: Any) -> None:
    """Run a program's threads, and close the log.

    Args:
        program: Says what runs.
        run: Its log, opened.
        thread: Makes a thread, as `threading.Thread` does.
        trace: For `sys.settrace`, or None.
    """
    if trace is not None:
        sys.settrace(trace)
    threads = [thread(target=_guarded(body), args=(run,), name=_name(body, i))
               for i, body in enumerate(program.bodies)]  # fmt: skip
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    with suppress(_Noted):
        _noted(run, run.log.close)
        run.say("closed")


class _Noted(Exception):  # noqa: N818  # the way out: the error is told already
    """An error was noted."""


def _noted(run: Run, call: Callable[[], object]) -> None:
    try:
        call()
    except Exception as error:
        if not (run.is_closing and _is_refusal(error)):
            run.say("error", f"{type(error).__name__}: {error}")
        raise _Noted from error


def _is_refusal(error: Exception) -> bool:
    """Tell whether somebody was told that the log is closed."""
    return isinstance(error, LogError) and "closed" in str(error)


def _guarded(body: Body) -> Body:
    def guarded(run: Run) -> None:
        with suppress(_Noted):
            _noted(run, lambda: body(run))

    return guarded


def _name(body: Body, number: int) -> str:
    return f"{number} {getattr(body, '__qualname__', 'thread').split('.')[0]}"
