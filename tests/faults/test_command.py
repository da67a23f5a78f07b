"""`tools/faults.py` itself: what it prints, and with which exit code it ends."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import suppress
from pathlib import Path

import faults as command
import pytest
from fault_injection import apart, report
from fault_injection.fault import CannotTryError, Outcome, Plan

from tests.faults.running import TOOLS


def _endless(plan: Plan) -> Generator[Outcome, None, None]:
    while True:
        yield Outcome("something", checked=3)


def _loses(plan: Plan) -> Generator[Outcome, None, None]:
    yield Outcome("all is well", checked=2)
    yield Outcome(f"seed {plan.seed}, bit 7", checked=2, lost=1, problem="gone", kept=plan.keep)


def _cannot(plan: Plan) -> Generator[Outcome, None, None]:
    raise CannotTryError("only root can do that")
    yield


@pytest.fixture(autouse=True)
def kinds(monkeypatch: pytest.MonkeyPatch) -> None:
    kinds = {"endless": _endless, "loses": _loses, "cannot": _cannot}
    monkeypatch.setattr(command, "KINDS", kinds)


def test_a_loss_is_an_exit_code_and_says_how_to_see_it_again(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The table counts it, and names the fault and where the log is kept."""
    code = command.main(["loses", "--seed", "9", "--keep", "over/here"])

    shown = capsys.readouterr().out
    assert 1 == code
    assert "loses: seed 9, bit 7: lost 1, invented 0. gone Kept: over/here" in shown
    assert ["loses", "2", "4", "1", "0", "0", "0"] in [line.split() for line in shown.splitlines()]


def test_what_cannot_be_tried_is_said_aloud(capsys: pytest.CaptureFixture[str]) -> None:
    """It is no failure, and no success that somebody could overlook."""
    code = command.main(["cannot"])

    assert 0 == code
    assert "NOT TRIED: cannot: only root can do that" in capsys.readouterr().out


def test_a_number_ends_an_endless_kind(capsys: pytest.CaptureFixture[str]) -> None:
    """So many faults, one JSON document."""
    code = command.main(["endless", "--faults", "5", "--json"])

    said = json.loads(capsys.readouterr().out)
    assert 0 == code
    assert (1, 5, 15) == (said["seed"], said["kinds"][0]["faults"], said["kinds"][0]["checked"])


def test_a_time_ends_an_endless_kind(capsys: pytest.CaptureFixture[str]) -> None:
    assert 0 == command.main(["endless", "--seconds", "0.05", "--json"])

    (said,) = json.loads(capsys.readouterr().out)["kinds"]
    assert 0.05 <= said["seconds"]
    assert 0 < said["faults"]


def test_a_kind_that_does_not_exist_is_named(tmp_path: Path) -> None:
    """A wrong word on the command line is the user's error, and says what there is."""
    done = subprocess.run(
        [sys.executable, TOOLS / "faults.py", "disks"], capture_output=True, text=True, check=False
    )

    assert 2 == done.returncode
    assert "no kind disks; there are: all, disk, syscalls" in done.stderr


class _Clock:
    """A clock that goes a second on, each time it is asked."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        self.now += 1
        return self.now


def _counts(out: str) -> dict[str, int]:
    return {kind["kind"]: kind["faults"] for kind in json.loads(out)["kinds"]}


def test_the_time_is_the_whole_runs(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each kind gets its share of what is left; what one does not need, the others get."""
    kinds = {"one": _endless, "short": _loses, "two": _endless, "three": _endless}
    monkeypatch.setattr(command, "KINDS", kinds)
    clock = _Clock()

    code = command.main(["--seconds", "80", "--json"], clock)

    counts = _counts(capsys.readouterr().out)
    assert 1 == code
    assert 2 == counts["short"]
    assert 15 <= counts["one"] <= 20
    assert 20 <= counts["two"] <= 30
    assert 20 <= counts["three"] <= 30
    assert 80 <= clock.now <= 90


def test_kinds_for_which_no_time_is_left_are_named(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are no success."""
    monkeypatch.setattr(command, "KINDS", {"one": _endless, "two": _endless})

    assert 0 == command.main(["--seconds", "0"], _Clock())

    out = capsys.readouterr().out
    assert "NOT TRIED: one: the time of --seconds was over" in out
    assert "NOT TRIED: two: the time of --seconds was over" in out


def test_a_line_for_each_kind_and_lines_meanwhile(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a pipe, every few seconds, and when a kind has ended."""
    monkeypatch.setattr(command, "KINDS", {"one": _endless, "two": _endless})

    command.main(["--seconds", "60", "--json"], _Clock())

    lines = capsys.readouterr().err.splitlines()
    assert ["one", "two"] == list(dict.fromkeys(line.partition(":")[0] for line in lines))
    ended = [line for line in lines if not line.endswith("…")]
    assert ["one", "two"] == [line.partition(":")[0] for line in ended]
    assert 3 <= len(lines) - len(ended) <= 12
    assert all("faults, " in line and "commits looked for" in line for line in lines)


def _hangs_in_a_fault(plan: Plan) -> Generator[Outcome, None, None]:
    """Yield once; then wait for a child that ends never, of which a file tells."""
    told = plan.keep
    yield Outcome("the first")
    child = os.fork()
    if child == 0:
        grandchild = subprocess.Popen(["sleep", "1000000"])
        told.with_suffix(".pids").write_text(f"{os.getpid()} {grandchild.pid}")
        told.with_suffix(".ready").touch()
        while True:
            time.sleep(1000)
    try:
        os.waitpid(child, 0)
    finally:
        told.with_suffix(".tidied").touch()


def test_a_fault_that_does_not_end_is_ended(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With all its processes; what it has to put away is put away."""
    monkeypatch.setattr(command, "KINDS", {"hangs": _hangs_in_a_fault, "loses": _loses})
    told = tmp_path / "told"

    def clock() -> float:
        """Stand still until the fault has begun, then be at its end."""
        return 5.0 * told.with_suffix(".ready").exists()

    monkeypatch.setattr(report, "LINE_EVERY_S", 0.01)
    monkeypatch.setattr(command, "LINE_EVERY_S", 0.01)
    command.main(["--seconds", "9", "--json", "--keep", str(told)], clock)

    assert {"hangs": 1, "loses": 2} == _counts(capsys.readouterr().out)
    assert told.with_suffix(".tidied").exists()
    for process in told.with_suffix(".pids").read_text().split():
        status = Path(f"/proc/{process}/stat")
        assert not status.exists() or ") Z " in status.read_text()


def _breaks(plan: Plan) -> Generator[Outcome, None, None]:
    yield Outcome("the first", checked=1)
    raise KeyError("no such thing")


def _dies(plan: Plan) -> Generator[Outcome, None, None]:
    yield Outcome("the first", checked=1)
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_kind_that_breaks_is_told_and_the_others_go_on(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """By an error of its own, or its process's end."""
    kinds = {"breaks": _breaks, "dies": _dies, "cannot": _cannot}
    monkeypatch.setattr(command, "KINDS", kinds)

    code = command.main([])

    shown = " ".join(capsys.readouterr().out.split())
    assert 1 == code
    assert "breaks: the kind itself: lost 0, invented 0. KeyError: 'no such thing'" in shown
    assert "dies: the kind itself: lost 0, invented 0. its process ended with code -9" in shown
    assert "NOT TRIED: cannot" in shown


def _leaves(plan: Plan) -> Generator[Outcome, None, None]:
    subprocess.Popen(["sleep", "1000000"], close_fds=False)
    yield Outcome("the first", checked=1)


def test_a_kind_that_leaves_a_process_ends_all_the_same(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that holds what it had open."""
    monkeypatch.setattr(command, "LINE_EVERY_S", 0.01)
    monkeypatch.setattr(command, "KINDS", {"leaves": _leaves})

    assert 0 == command.main(["--json"])

    assert {"leaves": 1} == _counts(capsys.readouterr().out)


def _swallows(plan: Plan) -> Generator[Outcome, None, None]:
    """Take whatever is raised in a fault for a part of it."""
    while True:
        with suppress(BaseException):
            plan.keep.touch()
            time.sleep(1000)
        yield Outcome("swallowed")


def test_a_kind_that_swallows_its_end_ends_behind_that_fault(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It need not be killed: it leaves its loop."""
    monkeypatch.setattr(command, "KINDS", {"swallows": _swallows})
    monkeypatch.setattr(command, "LINE_EVERY_S", 0.01)
    monkeypatch.setattr(apart, "GRACE_S", 1e9)
    told = tmp_path / "told"

    command.main(["--seconds", "9", "--json", "--keep", str(told)], lambda: 9.0 * told.exists())

    assert {"swallows": 0} == _counts(capsys.readouterr().out)
