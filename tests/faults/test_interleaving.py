"""The scheduler that owns all switches: it finds what needs a rare order, and finds it again."""

from __future__ import annotations

import random
from collections.abc import Callable
from itertools import islice
from types import ModuleType

import pytest
from fault_injection.interleaving.primitives import controlled_threading
from fault_injection.interleaving.scheduler import (
    Chooser,
    Parking,
    Priorities,
    RandomWalk,
    Scheduler,
    StuckError,
)

Program = Callable[[ModuleType, list[str]], None]
CHOOSERS: list[Callable[[random.Random], Chooser]] = [
    RandomWalk,
    lambda dice: Priorities(dice, steps=30),
    lambda dice: Parking(dice, {"acquire": 5, "release": 5, "set": 3}),
]


def _counts_without_lock(threading: ModuleType, said: list[str]) -> None:
    """Two threads read a number, and write it back one greater; a lock is held for each step."""
    count, lock = [0], threading.Lock()

    def add() -> None:
        for _ in range(3):
            with lock:
                before = count[0]
            with lock:
                count[0] = before + 1

    _together(threading, add, add)
    said.append(f"count {count[0]}")


def _locks_crosswise(threading: ModuleType, said: list[str]) -> None:
    one, other = threading.Lock(), threading.Lock()

    def hold(first: object, second: object) -> Callable[[], None]:
        def work() -> None:
            with first, second:  # type: ignore[attr-defined]
                said.append("both")

        return work

    _together(threading, hold(one, other), hold(other, one))


def _together(threading: ModuleType, *works: Callable[[], None]) -> None:
    threads = [threading.Thread(target=work) for work in works]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _run(program: Program, chooser: Callable[[random.Random], Chooser], seed: int) -> list[str]:
    scheduler = Scheduler(chooser(random.Random(seed)))
    said: list[str] = []
    scheduler.run(lambda: program(controlled_threading(scheduler, None), said), 30)
    return [*said, f"{scheduler.steps} steps"]


@pytest.mark.parametrize("chooser", CHOOSERS)
def test_a_lost_update_is_found_and_found_again(
    chooser: Callable[[random.Random], Chooser],
) -> None:
    """Within some orders, and by the same seed each time."""
    losing = (s for s in range(300) if "count 6" not in _run(_counts_without_lock, chooser, s))
    found = list(islice(losing, 2))

    assert 2 == len(found)
    for seed in found:
        once, twice = (_run(_counts_without_lock, chooser, seed) for _ in range(2))
        assert once == twice


def test_a_deadlock_is_told_with_the_stacks_of_all() -> None:
    """Two locks, taken crosswise: some orders end well, some do not."""
    ends = [_end_of(seed) for seed in range(60)]
    stuck = [end for end in ends if end]

    assert 0 < len(stuck) < len(ends)
    assert stuck[0].startswith("a deadlock")
    assert 2 <= stuck[0].count("in work")


def _end_of(seed: int) -> str:
    """Return why the run was stuck; empty: it was not."""
    try:
        _run(_locks_crosswise, RandomWalk, seed)
    except StuckError as error:
        return str(error)
    return ""


def test_a_wait_with_a_timeout_ends() -> None:
    """With what is waited for, or without."""
    ends = set()

    def program(threading: ModuleType, said: list[str]) -> None:
        event = threading.Event()
        _together(threading, lambda: said.append(f"{event.wait(9)}"), event.set)

    for seed in range(40):
        ends.update(_run(program, RandomWalk, seed)[:1])

    assert {"True", "False"} == ends
