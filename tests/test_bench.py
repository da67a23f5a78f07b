"""`tools/bench.py` on tiny logs: each row is there, each answer right; times are not judged."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from benchmark import worker
from benchmark.case import Case, Measured, Near, Peer, Work
from benchmark.made_building import ROOM, WALL, made_building
from benchmark.moments import moments
from benchmark.patrol import START_NS, STEP_NS, patrol
from benchmark.plain_fold import PlainFold, plain_answer, plain_answers
from benchmark.report import Result, growths, is_kept
from benchmark.worker import PeerFailedError, measure

TOOLS = Path(__file__).parents[1] / "tools"
ROWS = {
    "append": 3, "fold": 3, "now": 1, "moment": 4, "history": 1, "index": 1, "day": 1, "open": 3,
    "import": 2, "store": 3, "care": 3, "fleet": 1, "costmap": 3, "beliefs": 3, "view": 2,
    "start": 6, "sql": 1,
}  # fmt: skip
WITHOUT_PEER = (
    "In a store: planning", "Retain: old sightings thinned", "Retain: the older half goes",
)  # fmt: skip
"""Nobody else does this."""
MIB = 2**20
MOST_S = 1800
"""For a run of all rows, which took eight minutes beside ten busy processes."""


def bench(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, TOOLS / "bench.py", "--events", "300", "--rounds", "1", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.slow
@pytest.mark.timeout(MOST_S)
def test_all_peers_give_the_same_answers(tmp_path: Path) -> None:
    """One document with all rows: each peer's answer is right, its figures are there."""
    for name in ("mcap_ros2", "duckdb", "pyarrow", "rerun", "moto", "obstore", "distributed"):
        pytest.importorskip(name)

    done = bench("--json", "--dir", tmp_path)

    assert 0 == done.returncode, done.stderr
    said = json.loads(done.stdout)
    assert {"date", "command", "cores", "python", "versions", "cases", "growth"} <= said.keys()
    groups = [case["group"] for case in said["cases"]]
    assert ROWS == {group: groups.count(group) for group in ROWS}
    for case in said["cases"]:
        measured = [peer for peer in case["peers"] if "problem" not in peer]
        assert 1 + (case["title"] not in WITHOUT_PEER) <= len(measured), case["peers"]
        for peer in measured:
            assert peer["agrees"], (case["title"], peer["name"])
            assert 0 < peer["least_s"] <= peer["median_s"]
            assert 0 <= peer["median_cpu_s"]
            assert (peer["peak_bytes"] is None) == (case["group"] in ("start", "fleet"))
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_table_fits_a_terminal(tmp_path: Path) -> None:
    """The same for people: 80 columns, only the rows asked for."""
    done = bench("--only", "now", "--dir", tmp_path)

    assert 0 == done.returncode, done.stderr
    assert 80 >= max(map(len, done.stdout.splitlines()))
    assert "State now" in done.stdout
    assert "Append" not in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_nothing_is_left_of_a_run_that_was_stopped(tmp_path: Path, number: int) -> None:
    """Ctrl-C, or a kill, in the middle: its logs are removed, and the exit code says it."""
    command = [sys.executable, TOOLS / "bench.py", "--only", "fold", "--dir", tmp_path]
    with subprocess.Popen(command, stderr=subprocess.PIPE) as process:
        while not list(tmp_path.glob(".bench_*/*/log")):
            assert process.poll() is None
            time.sleep(0.05)

        process.send_signal(number)
        code = process.wait(timeout=300)

    assert 130 == code
    assert [] == list(tmp_path.iterdir())


def test_a_group_that_does_not_exist_is_named() -> None:
    """A wrong word on the command line is the user's error, and says what there is."""
    done = bench("--only", "append,speed")

    assert 2 == done.returncode
    assert "no group speed; there are: append, fold" in done.stderr


def test_a_patrol_is_the_same_as_events_and_as_columns() -> None:
    """
    Events in a dictionary fold and columns that are sorted give the same doors, now and earlier.
    """
    count, first, at_ns = 6_000, 5_500, START_NS + 4_000 * STEP_NS
    now, then = PlainFold(), PlainFold()
    for number, event in enumerate(patrol(count)):
        stamp = (event.happened_ns or 0, number)
        if number < first:
            now.apply(type(event).__name__, event, stamp)
        if event.happened_ns <= at_ns:
            then.apply(type(event).__name__, event, stamp)

    by_columns = plain_answer(count, first), plain_answer(count, at_ns=at_ns)

    assert (now.answer(), then.answer()) == by_columns
    assert (99, 100) == (len(now.answer()), len(then.answer()))


def test_the_plain_fold_knows_late_events() -> None:
    """A fold in the order of recording gives another answer."""
    by_time, by_number = (
        plain_answers(100_000, None, (None,), late_counts=late)[None] for late in (True, False)
    )

    assert by_time.keys() == by_number.keys()
    assert by_time != by_number


def test_a_few_moments_lie_as_evenly_as_all() -> None:
    """Whoever answers only seven of them in his time meets each eighth of the log but the first."""
    few = [(at_ns - START_NS) / (1000 * STEP_NS) for at_ns in moments(1000)[:7]]

    assert [n / 8 for n in range(1, 8)] == sorted(few)


def test_a_small_building_is_a_corner_of_a_large_one() -> None:
    """What a slow peer is given of the costmap is as full as the whole."""
    small, large = made_building(1000), made_building(2000)
    room = slice(WALL, ROOM[1]), slice(WALL, ROOM[0])
    walls = {(round(line.x, 6), round(line.y, 6)) for line in large.doors.values()}

    assert (small.costs[room] == large.costs[room]).all()
    assert {(round(line.x, 6), round(line.y, 6)) for line in small.doors.values()} < walls
    assert (31, 142) == (len(small.doors), len(large.doors))


@pytest.mark.parametrize(
    ("answer", "is_right"),
    [
        ((2.0, 0.0), True), ((2.001, 0.0), True), ((2.003, 0.0), False), ((2.0, 1e-6), True),
        ((2.0, 1e-5), False), ((2.0,), False), ((2.0, float("nan")), False), (2.0, False),
    ],
)  # fmt: skip
def test_an_answer_that_is_near_enough_is_right(answer: object, is_right: bool) -> None:
    """Within a thousandth of each number, and near 0 within a millionth; as many, and numbers."""
    found = answer == Near((2.0, 0.0), 1e-3)

    assert is_right is found


def _grown(promise: str, *seconds: float) -> list[Result]:
    """Return a case at sizes 10, 100 …, whose one peer took so long."""
    peer = Peer("semmap-log", partial(_answers, 1), expected=1)
    return [
        (
            Case("moment", "Moment, warm", "ms", (peer,), 1, events=10**n, growth_promise=promise),
            [Measured(peer, (time,), agrees=True)],
        )
        for n, time in enumerate(seconds, start=1)
    ]


@pytest.mark.parametrize(
    ("promise", "value", "kept"),
    [
        ("≥ 80x", 80.0, True), ("≥ 80x", 79.9, False), ("< 150 ms", 150.0, False),
        ("< 1 %", 0.5, True), ("", 1.0, None), ("≥ 80x", None, None),
    ],
)  # fmt: skip
def test_a_promise_is_kept_or_not(promise: str, value: float | None, kept: bool | None) -> None:
    """The table's words are judged as they read."""
    judged = is_kept(promise, value)

    assert kept is judged


def test_growth_is_from_the_smallest_log_to_the_largest() -> None:
    """What lies between does not count; one size alone has no growth."""
    (growth,) = growths(_grown("< 2x", 0.010, 0.090, 0.015))

    assert (10, 1000, 1.5) == (growth.from_events, growth.to_events, round(growth.times, 6))
    assert is_kept(growth.promise, growth.times)
    assert [] == list(growths(_grown("< 2x", 0.010)))


def test_the_slowest_turns_and_the_share_read_are_told() -> None:
    """p99 of a hundred turns is the last but one; a share is the median of what was read."""
    peer = Peer("semmap-log", partial(_answers, 1), expected=1, store_bytes=1000)

    measured = Measured(peer, tuple(range(1, 101)), read_bytes=(0, 10, 20))

    assert 99 == measured.p99_s
    assert 0.01 == measured.share_read


def _answers(value: int) -> Work:
    return Work(lambda _: value)


def _needs_memory(size: int) -> Work:
    return Work(lambda _: len(b"x" * size))


def _needs_a_library() -> Work:
    import a_library_that_nobody_has  # noqa: F401

    raise AssertionError


def _fails() -> Work:
    raise ValueError("no such luck")


def _fails_later() -> Work:
    return Work(lambda _: _fails())


def _case(*peers: Peer) -> Case:
    return Case("group", "A task", "ms", peers, rounds=2, burst=3)


@pytest.mark.slow
def test_a_wrong_answer_is_seen() -> None:
    """What a peer answers is compared, and each turn that counts is timed."""
    right = Peer("right", partial(_answers, 42), expected=42)
    wrong = Peer("wrong", partial(_answers, 41), expected=42)

    first, second = measure(_case(right, wrong))

    assert (True, False) == (first.agrees, second.agrees)
    assert 6 == len(first.seconds) == len(second.seconds)


@pytest.mark.slow
def test_memory_is_that_of_the_peer_itself() -> None:
    """A peer that takes 100 MiB shows them, the other, measured beside it, does not."""
    great, small = 100 * MIB, 1
    peers = [Peer(str(n), partial(_needs_memory, n), expected=n) for n in (small, great)]

    modest, greedy = measure(_case(*peers))

    assert 90 * MIB < greedy.peak_bytes - modest.peak_bytes < 110 * MIB


@pytest.mark.slow
def test_a_peer_that_is_not_installed_only_says_so() -> None:
    """The others are measured all the same."""
    here = Peer("here", partial(_answers, 1), expected=1)
    absent = Peer("absent", _needs_a_library, expected=1)

    first, second = measure(_case(here, absent))

    assert first.agrees
    assert "needs a_library_that_nobody_has" == second.problem


@pytest.mark.parametrize("prepare", [_fails, _fails_later])
def test_a_peer_that_fails_stops_the_run(prepare: Callable[[], Work]) -> None:
    """An error in a peer's process comes out with its traceback, whenever it was met."""
    with pytest.raises(PeerFailedError, match=r"(?s)broken:.*no such luck"):
        measure(_case(Peer("broken", prepare, expected=1)))


class _OwnTime:
    """A clock for a peer's process: it goes on when the peer works, and else stands still."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def perf_counter(self) -> float:
        return self.now_s

    process_time = perf_counter

    def pass_by(self, seconds: float) -> None:
        self.now_s += seconds


def _takes(seconds: float) -> Work:
    worker.time = _OwnTime()  # of this process, which is the peer's
    return Work(lambda _: worker.time.pass_by(seconds))


@pytest.mark.slow
def test_slow_peers_take_fewer_turns() -> None:
    """A round ends with the burst, or when its time is over; a turn is never cut off."""
    peers = tuple(Peer(str(s), partial(_takes, s), expected=None) for s in (0.0, 0.75))
    case = Case("group", "A task", "ms", peers, rounds=1, burst=5, burst_s=3.0)

    quick, slow = measure(case)

    assert (0.0,) * 5 == quick.seconds
    assert (0.75,) * 4 == slow.seconds


def _cores() -> Work:
    return Work(lambda _: len(os.sched_getaffinity(0)))


@pytest.mark.slow
def test_a_peer_is_held_on_its_cores() -> None:
    """One core is one core, whatever the machine has; more than there are is said."""
    peers = tuple(Peer(str(n), _cores, expected=n, cores=n) for n in (1, 1000))

    one, many = measure(_case(*peers))

    assert one.agrees
    assert "needs 1000 cores" == many.problem
