"""`patrol-plan --follow` as a user types it: on a log of what was, and on one that goes on."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from shutil import copytree, rmtree

import pytest

import semmap_log as sl
from semmap_log.cli import INTERRUPTED
from semmap_log.core.model.events import DoorPassed, Event
from semmap_log.core.model.moments import SECOND_NS, parse_instant
from tests.analysis.planning.ward import FRONT, HALL, LAB, SIDE, TZ, ward
from tests.conftest import SteadyClock
from tests.live.ros.running import wait_until
from tests.verbs import run

FOLLOW = ("--from", HALL, "--start", "2026-03-23T10:00", "--rooms", "lab,2", "--follow")
START_NS = parse_instant("2026-03-23T10:00", tz=TZ)
ROUND = (
    (DoorPassed(door_id=LAB, passed=True), 10),
    (DoorPassed(door_id=FRONT, passed=False), 40),
    (DoorPassed(door_id=SIDE, passed=True), 52),
)


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return ward(tmp_path_factory.mktemp("plan") / "log").path


@pytest.fixture
def path(kept: Path, tmp_path: Path) -> Path:
    copytree(kept, tmp_path / "log")
    return tmp_path / "log"


def tell(path: Path, *told: tuple[Event, int]) -> None:
    clock = SteadyClock(START_NS + 3600 * SECOND_NS)
    with sl.append(path, clock=clock) as log:
        for event, at_s in told:
            log.append([replace(event, happened_ns=START_NS + at_s * SECOND_NS)])


@pytest.mark.usefixtures("terminal")
def test_a_round_that_was(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The plan, a line a step with when, what, where, P and why; at its end it ends by itself."""
    tell(path, *ROUND)

    code = run("patrol-plan", str(path), *FOLLOW)

    out, err = capsys.readouterr()
    assert code == 0
    assert "mean time to visit" in out
    first, second, last = [line for line in out.splitlines() if line.startswith("2026-")]
    assert first.startswith("2026-03-23 10:00:10  lab: passed. Next: room 2 by front (1) at 10:00:")
    assert "likely open; 1 left" in first
    assert "front: gave up. Next: room 2 by side (2)" in second
    assert last == "2026-03-23 10:00:52  side: passed. The round is over."
    assert err.endswith("visited: lab, room 2\n")


def test_as_json_one_object_a_line(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The plan first; the last one says what became of the round."""
    tell(path, *ROUND)

    assert run("patrol-plan", str(path), *FOLLOW, "--json") == 0

    plan, *steps = map(json.loads, capsys.readouterr().out.splitlines())
    assert [stop["door"] for stop in plan["stops"]] == ["lab", "front"]
    assert [step["because"] for step in steps] == ["lab: passed", "front: gave up", "side: passed"]
    assert [step["next"] and step["next"]["door_id"] for step in steps] == [FRONT, SIDE, None]
    assert [step["next"]["stop"] for step in steps[:2]] == [2, 2]
    assert [step["stops_left"] for step in steps] == [1, 1, 0]
    assert (steps[-1]["visited"], steps[-1]["not_visited"]) == (["lab", "room 2"], [])
    assert set(steps[0]) == {"event", "happened", "because", "next", "stops_left"}


def test_in_a_pipe_cells_under_a_head(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Behind the table of the plan, after an empty line."""
    tell(path, *ROUND)

    assert run("patrol-plan", str(path), *FOLLOW) == 0

    out = capsys.readouterr().out
    assert "\n\n" in out
    head, *rows = out.split("\n\n")[1].splitlines()
    assert head.split("\t")[:3] == ["event", "happened", "because"]
    assert {row.count("\t") for row in rows} == {head.count("\t")}
    assert [row.split("\t")[3] for row in rows] == ["room 2", "room 2", "-"]


@pytest.mark.slow
def test_a_log_that_goes_on(path: Path) -> None:
    """Each step comes when it is recorded, over a compaction; Ctrl-C is the way to end it."""
    with _following(path) as process:
        assert process.stdout is not None
        plan = json.loads(process.stdout.readline())
        tell(path, ROUND[0])
        first = json.loads(process.stdout.readline())
        _semmap("compact", path)
        tell(path, ROUND[1])
        second = json.loads(process.stdout.readline())
        process.send_signal(signal.SIGINT)
        rest, complaints = process.communicate(timeout=60)

    assert len(plan["stops"]) == 2
    assert (first["next"]["door"], second["next"]["door"]) == ("front", "side")
    assert (process.returncode, rest, complaints) in {(0, "", ""), (INTERRUPTED, "", "")}


@pytest.mark.slow
def test_a_log_that_is_removed(path: Path) -> None:
    """One line says so; it does not wait for ever."""
    with _following(path) as process:
        assert process.stdout is not None
        process.stdout.readline()
        rmtree(path)
        _, complaints = process.communicate(timeout=60)

    assert process.returncode == 1
    assert "Traceback" not in complaints
    assert str(path) in complaints


@pytest.mark.slow
def test_a_reader_that_goes(path: Path) -> None:
    """As `head` does: it ends though nothing is recorded any more."""
    with _following(path) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.stdout.close()
        wait_until(lambda: process.poll() is not None, "its end")
        assert process.stderr is not None
        complaints = process.stderr.read()

    assert (process.returncode, complaints) == (141, "")


def _following(path: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "semmap_log", "patrol-plan", str(path), *FOLLOW, "--json"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ,
    )  # fmt: skip


def _semmap(*arguments: object) -> None:
    command = [sys.executable, "-m", "semmap_log", *map(str, arguments)]
    subprocess.run(command, check=True, capture_output=True)
