"""Reading ahead on other threads: in order, and wherever no other threads can be had."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
import threading
from collections.abc import Callable
from functools import partial

import pytest

from semmap_log.core.io.prefetch import ahead


def squares(count: int) -> list[Callable[[], int]]:
    """Return tasks that give the squares of 0, 1, 2 …"""
    return [partial(pow, n, 2) for n in range(count)]


@pytest.fixture(params=[1, 2, 3])
def cores(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    """So many cores this process may use."""
    count: int = request.param
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(count)))
    return count


@pytest.mark.usefixtures("cores")
def test_results_come_in_the_order_of_the_tasks() -> None:
    """On one core and on several."""
    found = list(ahead(squares(50)))

    assert [n * n for n in range(50)] == found


@pytest.mark.usefixtures("cores")
def test_an_error_comes_in_its_place() -> None:
    """What was done before it is used; the tasks behind it are given up."""

    def fails() -> int:
        raise ValueError("no such chunk")

    results = ahead([*squares(3), fails, *squares(3)])

    assert [0, 1, 4] == [next(results) for _ in range(3)]
    with pytest.raises(ValueError, match="no such chunk"):
        next(results)


def test_who_waits_works_at_what_nobody_has_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    """On two cores there is one other thread: two tasks that meet are both worked at."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    meeting = threading.Barrier(2, timeout=60)

    found = list(ahead([meeting.wait, meeting.wait, *squares(5)]))

    assert {0, 1} == set(found[:2])
    assert [0, 1, 4, 9, 16] == found[2:]


_BEGIN = """
    import atexit, os, signal, sys, threading
    from functools import partial
    from semmap_log.core.io.prefetch import ahead

    os.sched_getaffinity = lambda _: {0, 1}
    signal.alarm(100)  # what hangs fails

    def squares():
        return ahead(partial(pow, n, 2) for n in range(50))

    def say(results):
        os.write(1, f"{sum(results)}\\n".encode())  # at once: two processes write
"""
_SUM = sum(n * n for n in range(50))


def run(script: str) -> list[str]:
    """Run a script in a process of its own; return the words it prints."""
    whole = textwrap.dedent(_BEGIN) + textwrap.dedent(script)
    done = subprocess.run(
        [sys.executable, "-c", whole], check=False, capture_output=True, text=True
    )
    assert (0, "") == (done.returncode, done.stderr)
    return done.stdout.split()


def test_a_log_can_be_read_while_the_interpreter_ends() -> None:
    """In a thread that outlives the main one, and in what is left to the very end."""
    script = """
        def outlives():
            threading.main_thread().join()
            say(squares())

        atexit.register(lambda: say(squares()))
        threading.Thread(target=outlives).start()
    """

    said = run(script)

    assert 2 * [str(_SUM)] == said


def test_a_forked_child_reads_on() -> None:
    """Its parent's threads are not there to do what was begun; both come to the end."""
    script = """
        results = squares()
        first = next(results)
        pid = os.fork()
        signal.alarm(100)  # a child's own
        say(results)
        if pid == 0:
            os._exit(0)
        sys.exit(os.waitpid(pid, 0)[1])
    """

    said = run(script)

    assert 2 * [str(_SUM)] == said
