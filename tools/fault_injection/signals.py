"""Signals to a process that appends, and memory that runs out while it does."""

from __future__ import annotations

import os
import random
import resource
import signal
import time
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import semmap_log as sl
from fault_injection.fault import Outcome, Plan
from fault_injection.forking import Child
from fault_injection.ledger import Ledger
from fault_injection.player import Tell
from semmap_log.errors import LogError, LogLockedError

ROUNDS = 150
STOPPED_S = 5.0
CHILD_S = 300
"""No child lives longer, whatever it waits for."""
MOST_MEMORY = 2**25
"""With so much to be had, a great commit goes through."""
DOORS_A_COMMIT = 8_000


def signals(plan: Plan) -> Generator[Outcome, None, None]:
    """Signal, starve and stop writers in child processes."""
    yield stopped(plan.folder / "stopped", STOPPED_S)
    dice = random.Random(plan.seed)
    rounds = plan.most(2 * ROUNDS) // 2
    for number in range(rounds):
        yield signalled(plan.folder / f"signal-{number}", dice)
        yield starved(plan.folder / f"memory-{number}", int(MOST_MEMORY * number / rounds))


def signalled(path: Path, dice: random.Random) -> Outcome:
    """Send a signal to a process that appends, at any moment."""
    sent = dice.choice((signal.SIGINT, signal.SIGTERM, signal.SIGKILL))
    wait = dice.uniform(0, 0.03)

    def send(child: int) -> None:
        time.sleep(wait)
        os.kill(child, sent)

    ledger = _in_a_child(path, _append_for_ever, send)
    return ledger.outcome(path, f"{sent.name} after {wait * 1000:.1f} ms of appending")


def starved(path: Path, more: int) -> Outcome:
    """Append great commits in a process that may take only so many bytes of memory more."""
    ledger = _in_a_child(path, partial(_append_with_memory, more), lambda _: None)
    return ledger.outcome(path, f"append with {more:,} bytes of memory to be had")


def stopped(path: Path, seconds: float) -> Outcome:
    """Stop a writer for a while: readers read on, nobody takes its place, then it goes on."""
    problems: list[str] = []

    def stop(child: int) -> None:
        _until(lambda: len(sl.read(path).replay()) > 0)
        os.kill(child, signal.SIGSTOP)
        _until(lambda: _state_of(child) == "T")  # not before its system call is over
        before = len(sl.read(path).replay())
        with suppress(LogLockedError):
            sl.append(path, compact=False).close()
            problems.append("a second writer got in")
        time.sleep(seconds)
        after = len(sl.read(path).replay())
        if before != after or not before:
            problems.append(f"{before} doors when it was stopped, {after} later")
        os.kill(child, signal.SIGCONT)
        time.sleep(0.2)
        os.kill(child, signal.SIGINT)

    outcome = _in_a_child(path, _append_for_ever, stop).outcome(path, f"stopped for {seconds} s")
    return replace(outcome, problem="; ".join([*problems, outcome.problem]).strip("; "))


def _until(is_so: Callable[[], bool]) -> None:
    """Return once something is so, or no child lives that could make it so."""
    deadline = time.monotonic() + CHILD_S
    while not is_so() and time.monotonic() < deadline:
        time.sleep(0.01)


def _state_of(process: int) -> str:
    """Return the letter that ps has for it."""
    return Path(f"/proc/{process}/stat").read_text().rpartition(") ")[2][0]


def _in_a_child(
    path: Path, work: Callable[[Ledger, Path], None], meanwhile: Callable[[int], None]
) -> Ledger:
    """Fork a child that works, do something to it, and return what it told before it ended."""
    sl.create(path, tz="UTC", compact=False).close()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})

    def in_child(tell: Tell) -> None:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(CHILD_S)
        signal.signal(signal.SIGINT, _interrupt)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        work(Ledger(tell=lambda *told: tell(" ".join(map(str, told)))), path)

    child = Child(in_child)  # which nothing may interrupt before it is in its own code
    signal.pthread_sigmask(signal.SIG_SETMASK, before)
    ledger = Ledger()
    try:
        meanwhile(child.pid)
    finally:
        lines = child.wait().lines
    for line in lines:
        word, event, door = line.split()
        ledger.note(word, int(event), int(door))
    return ledger


_interrupts: list[int] = []
"""The interrupts that a child was sent."""


def _interrupt(number: int, _: object) -> None:
    """Raise KeyboardInterrupt, and take it down: what is raised in a finalizer gets lost."""
    _interrupts.append(number)
    raise KeyboardInterrupt


def _append_for_ever(ledger: Ledger, path: Path) -> None:
    """Append until something happens; then do what a program does that caught it."""
    log = sl.append(path, compact=False)
    with suppress(BaseException):
        while not _interrupts:
            ledger.add_doors(log)
    _continue(ledger, log)


def _append_with_memory(more: int, ledger: Ledger, path: Path) -> None:
    """Append ever greater commits with so much memory, then small ones with all of it."""
    log = sl.append(path, compact=False)
    ledger.add_doors(log, 10)
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    with suppress(MemoryError, LogError):
        resource.setrlimit(resource.RLIMIT_AS, (_address_space() + more, hard))
        for size in (10, DOORS_A_COMMIT):
            ledger.add_doors(log, size)
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    _continue(ledger, log)


def _continue(ledger: Ledger, log: sl.DoorLogWriter) -> None:
    for call in (partial(ledger.add_doors, log), log.close):
        with suppress(LogError):
            call()


def _address_space() -> int:
    """Return how many bytes of addresses this process has."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return pages * resource.getpagesize()
