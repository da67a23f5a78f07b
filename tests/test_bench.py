"""`tools/bench.py` on tiny logs: each row is there, each answer right; times are not judged."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from benchmark.case import Case, Peer, Work
from benchmark.worker import PeerFailedError, measure

TOOLS = Path(__file__).parents[1] / "tools"
ROWS = {
    "append": 3, "fold": 3, "now": 1, "moment": 3, "history": 1, "day": 1, "open": 3, "import": 2,
    "start": 2,
}  # fmt: skip
MIB = 2**20


def bench(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, TOOLS / "bench.py", "--events", "300", "--rounds", "1", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)


def test_all_peers_give_the_same_answers(tmp_path: Path) -> None:
    """
    One document with all rows: each peer's answer is right, its figures are there.
    """
    pytest.importorskip("mcap_ros2")

    done = bench("--json", "--dir", tmp_path)

    assert 0 == done.returncode, done.stderr
    said = json.loads(done.stdout)
    assert {"date", "command", "cores", "python", "versions", "cases", "notes"} <= said.keys()
    groups = [case["group"] for case in said["cases"]]
    assert ROWS == {group: groups.count(group) for group in ROWS}
    for case in said["cases"]:
        ours, *others = case["peers"]
        assert others
        assert 1 == ours["times_ours"]
        for peer in case["peers"]:
            assert peer["agrees"], (case["title"], peer["name"])
            assert 0 < peer["least_s"] <= peer["median_s"]
            assert (peer["peak_bytes"] is None) == (case["group"] == "start")
    assert [] == list(tmp_path.iterdir())


def test_the_table_fits_a_terminal(tmp_path: Path) -> None:
    """
    The same for people: 80 columns, only the rows asked for.
    """
    done = bench("--only", "start", "--dir", tmp_path)

    assert 0 == done.returncode, done.stderr
    assert 80 >= max(map(len, done.stdout.splitlines()))
    assert "semmap-log --help" in done.stdout
    assert "Replay" not in done.stdout


def test_a_group_that_does_not_exist_is_named() -> None:
    """
    A wrong word on the command line is the user's error, and says what there is.
    """
    done = bench("--only", "append,speed")

    assert 2 == done.returncode
    assert "no group speed; there are: append, replay" in done.stderr


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


def test_a_wrong_answer_is_seen() -> None:
    """
    What a peer answers is compared, and each turn that counts is timed.
    """
    right = Peer("right", partial(_answers, 42), expected=42)
    wrong = Peer("wrong", partial(_answers, 41), expected=42)

    first, second = measure(_case(right, wrong))

    assert (True, False) == (first.agrees, second.agrees)
    assert 6 == len(first.seconds) == len(second.seconds)


def test_memory_is_that_of_the_peer_itself() -> None:
    """
    A peer that takes 100 MiB shows them, the other, measured beside it, does not.
    """
    great, small = 100 * MIB, 1
    peers = [Peer(str(n), partial(_needs_memory, n), expected=n) for n in (small, great)]

    modest, greedy = measure(_case(*peers))

    assert 90 * MIB < greedy.peak_bytes - modest.peak_bytes < 110 * MIB


def test_a_peer_that_is_not_installed_only_says_so() -> None:
    """
    The others are measured all the same.
    """
    here = Peer("here", partial(_answers, 1), expected=1)
    absent = Peer("absent", _needs_a_library, expected=1)

    first, second = measure(_case(here, absent))

    assert first.agrees
    assert "needs a_library_that_nobody_has" == second.problem


@pytest.mark.parametrize("prepare", [_fails, _fails_later])
def test_a_peer_that_fails_stops_the_run(prepare: Callable[[], Work]) -> None:
    """
    An error in a peer's process comes out with its traceback, whenever it was met.
    """
    with pytest.raises(PeerFailedError, match=r"(?s)broken:.*no such luck"):
        measure(_case(Peer("broken", prepare, expected=1)))
