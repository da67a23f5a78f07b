"""Work by turns: who has had least of the thread's time comes first, and nobody's work is lost."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from semmap_log.live.planners.line_protocol.connection import Connection, Turns
from tests.live.ros.running import wait_until

PART_S = 0.01


@pytest.fixture
def clients() -> Iterator[list[Connection]]:
    pairs = [socket.socketpair() for _ in range(2)]
    yield [Connection(ours, is_known=True) for ours, _ in pairs]
    for pair in pairs:
        for end in pair:
            end.close()


@pytest.fixture
def turns() -> Iterator[Turns]:
    running = Turns("turns of a test")
    yield running
    running.close()


class Doing:
    """What was done, in order."""

    def __init__(self) -> None:
        self.done: list[str] = []

    def work(
        self,
        name: str,
        parts: int,
        before: Callable[[], object] = lambda: None,
        *,
        part_s: float = PART_S,
    ) -> Iterator[None]:
        """Work of so many parts, each of which takes a while; something comes before the first."""
        before()
        for number in range(parts):
            time.sleep(part_s)
            self.done.append(name)
            if number < parts - 1:
                yield


def test_one_that_comes_waits_for_one_part_of_anothers(
    turns: Turns, clients: list[Connection]
) -> None:
    doing, long, short = Doing(), *clients

    turns.add(long, doing.work("long", 4, lambda: turns.add(short, doing.work("short", 1))))
    turns.close()

    assert ["long", "short", "long", "long", "long"] == doing.done


def test_short_parts_come_more_often_than_long_ones(
    turns: Turns, clients: list[Connection]
) -> None:
    doing, long, short = Doing(), *clients

    def begin() -> None:
        turns.add(short, doing.work("short", 3, part_s=0.001))

    turns.add(long, doing.work("long", 3, begin, part_s=0.2))
    turns.close()

    assert ["long", "short", "short", "short", "long", "long"] == doing.done


def test_who_comes_back_has_no_turns_saved(turns: Turns, clients: list[Connection]) -> None:
    """Half an hour of silence is no right to half an hour of work before others have any."""
    doing, busy, silent = Doing(), *clients
    turns.add(busy, doing.work("busy", 10))
    wait_until(lambda: len(doing.done) == 10, "the first work")

    turns.add(busy, doing.work("busy", 6, lambda: turns.add(silent, doing.work("back", 6))))
    turns.close()

    assert "busy" in doing.done[10 + doing.done[10:].index("back") : _last(doing.done, "back")]


def _last(names: list[str], name: str) -> int:
    return len(names) - 1 - names[::-1].index(name)


def test_no_work_is_done_for_who_is_gone(turns: Turns, clients: list[Connection]) -> None:
    doing, one, other = Doing(), *clients

    def leave() -> None:
        one.is_gone = True

    turns.add(one, doing.work("one", 5, leave))
    turns.add(other, doing.work("other", 2))
    turns.close()

    assert ["one", "other", "other"] == doing.done


def test_work_that_fails_harms_nobody(turns: Turns, clients: list[Connection]) -> None:
    doing, one, other = Doing(), *clients
    fails = threading.Event()

    def fail() -> None:
        fails.set()
        raise RuntimeError("of a test")

    turns.add(one, doing.work("one", 5, fail))
    turns.add(other, doing.work("other", 2))
    turns.close()

    assert (True, ["other", "other"]) == (fails.is_set(), doing.done)
