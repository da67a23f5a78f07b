"""`tools/faults.py` itself: what it prints, and with which exit code it ends."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path

import faults as command
import pytest
from fault_injection import report
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


def test_a_kind_that_does_not_exist_is_named(tmp_path: Path) -> None:
    """A wrong word on the command line is the user's error, and says what there is."""
    done = subprocess.run(
        [sys.executable, TOOLS / "faults.py", "disks"], capture_output=True, text=True, check=False
    )

    assert 2 == done.returncode
    assert "no kind disks; there are: all, disk, syscalls" in done.stderr


def test_lines_tell_how_far_it_is(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a pipe, every few seconds, and when a kind has ended."""
    monkeypatch.setattr(report, "LINE_EVERY_S", 0.0)

    command.main(["endless", "--faults", "3", "--json"])

    *meanwhile, ended = capsys.readouterr().err.splitlines()
    assert 3 == len(meanwhile)
    assert all(line.startswith("endless: ") and line.endswith("…") for line in meanwhile)
    assert ended.startswith("endless: 3 faults, 9 commits looked for, 0 bad")


def _breaks(plan: Plan) -> Generator[Outcome, None, None]:
    yield Outcome("the first", checked=1)
    raise KeyError("no such thing")


def test_a_kind_that_breaks_is_told_and_the_others_go_on(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds = {"breaks": _breaks, "cannot": _cannot}
    monkeypatch.setattr(command, "KINDS", kinds)

    code = command.main([])

    shown = " ".join(capsys.readouterr().out.split())
    assert 1 == code
    assert "breaks: the kind itself: lost 0, invented 0. KeyError: 'no such thing'" in shown
    assert "NOT TRIED: cannot" in shown
