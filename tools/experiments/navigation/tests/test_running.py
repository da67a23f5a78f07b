"""Runs: the same bytes from the same seed, also after a kill; what setups share."""

from __future__ import annotations

import argparse
import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import fields
from itertools import pairwise
from pathlib import Path

import navigation_experiment
import numpy as np
import pytest
from patrol_sim.tests.corridor import building

from navigation.batch import run_all
from navigation.options import OptionError, RunOptions
from navigation.reading_verbs import read_runs
from navigation.run_verb import HELP, add_arguments, seeds, tasks_of
from navigation.running import RunTask, run
from navigation.runs import read_run, second_of
from navigation.setups import SETUPS
from navigation.tables.experiment import tables_of
from navigation.tests.world_of_three_rooms import floor
from navigation.ways import Way
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorUpdated, RobotPose

PROGRAM = Path(navigation_experiment.__file__)
SHORT = RunOptions(goals=4)


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    pytest.importorskip("pyastar2d", reason="not installed: pip install 'semmap-log[experiment]'")
    return building(tmp_path)


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def doors_of(folder: Path) -> list[tuple[int, int, DoorState]]:
    history = read_run(folder).world.history(kinds=(DoorAdded, DoorUpdated))
    return [(e.happened_ns, e.event.door_id, e.event.state) for e in history]


@pytest.mark.parametrize("setup", SETUPS)
def test_the_same_seed_gives_the_same_bytes(tmp_path: Path, plan: Path, setup: str) -> None:
    """
    And another seed others; each run reaches its goals.
    """
    task = RunTask(plan, 1, setup, "fixed", 5, SHORT)
    once, again = (run(task, floor(), tmp_path / name) for name in ("once", "again"))
    other = run(RunTask(plan, 1, setup, "fixed", 6, SHORT), floor(), tmp_path / "once")

    assert files(once) == files(again)
    assert files(once) != files(other)
    assert [goal.outcome.value for goal in read_run(once).goals].count("reached") == 4


def test_fixed_seeds_share_doors_and_goals_to_the_bit(tmp_path: Path, plan: Path) -> None:
    """
    Whatever the robot does: doors as long as both runs last, goals by their numbers.
    """
    options = RunOptions(goals=20, every_s=5.0, base=0.2)
    runs = [
        run(RunTask(plan, 1, setup, "fixed", 2, options), floor(), tmp_path)
        for setup in ("no_map", "map_star", "patrol")
    ]
    told = [doors_of(folder) for folder in runs]
    least = min(map(len, told))
    assert least > 10
    assert told[0][:least] == told[1][:least] == told[2][:least]
    places = [{g.number: (g.x, g.y, g.kind) for g in read_run(folder).goals} for folder in runs]
    shared = places[0].keys() & places[1].keys() & places[2].keys()
    assert len(shared) >= 8
    assert all(places[0][n] == places[1][n] == places[2][n] for n in shared)


def test_random_seeds_share_nothing(tmp_path: Path, plan: Path) -> None:
    one, other = (
        run(RunTask(plan, 1, setup, "random", 2, SHORT), floor(), tmp_path)
        for setup in ("no_map_star", "map_star")
    )
    places = [{(g.x, g.y) for g in read_run(folder).goals} for folder in (one, other)]
    assert not places[0] & places[1]


@pytest.mark.parametrize("setup", ["no_map", "no_map_star", "map_star"])
def test_the_robot_goes_through_no_wall_and_no_shut_door(
    tmp_path: Path, plan: Path, setup: str
) -> None:
    """
    From pose to pose, in a world whose doors toggle every half minute.
    """
    task = RunTask(plan, 1, setup, "fixed", 3, RunOptions(goals=15, every_s=30.0))
    found = read_run(run(task, floor(), tmp_path))
    told = [
        (second_of(e.happened_ns), e.event.door_id, e.event.state is DoorState.OPEN)
        for e in found.world.history(kinds=(DoorAdded, DoorUpdated))
    ]
    poses = [
        (second_of(e.happened_ns), e.event.x, e.event.y)
        for e in found.belief.history(kinds=(RobotPose,))
    ]
    crossed = 0
    for (_, *before), (at_s, *after) in pairwise(poses):
        cell = floor().cell((after[0], after[1]))
        assert cell is not None
        assert not floor().walls[cell]
        for crossing in Way(np.array([before, after])).crossings(floor()):
            crossed += 1
            assert [is_open for t, door, is_open in told if door == crossing.door and t < at_s][-1]
        assert math.dist(before, after) < 1.2
    assert crossed >= 4


@pytest.mark.parametrize("setup", SETUPS)
def test_what_is_given_up_after_driving_had_a_way(tmp_path: Path, plan: Path, setup: str) -> None:
    """
    And what was rejected at once had none: its records say so, and nobody moved.
    """
    options = RunOptions(goals=15, every_s=30.0)
    found = read_run(run(RunTask(plan, 1, setup, "fixed", 3, options), floor(), tmp_path))
    for goal in found.goals:
        figures = goal.figures
        assert (figures["planned_s"] is None) == (figures["plans"] == 0 == figures["path_m"])
        if goal.outcome.value == "after_driving":
            assert figures["plans"] >= 1
            assert figures["blocked"] >= 1


def test_a_sighting_is_right_but_for_what_comes_later(tmp_path: Path, plan: Path) -> None:
    task = RunTask(plan, 1, "map_star", "fixed", 3, RunOptions(goals=20, every_s=20.0))
    found = read_run(run(task, floor(), tmp_path))
    seen = list(found.belief.history(kinds=(DoorObserved,)))
    assert len(seen) > 5
    for entry in seen:
        truth = found.world.replay(at=entry.happened_ns).doors[entry.event.door_id]
        assert truth.state == entry.event.state
        assert entry.event.accuracy_open == 0.9


def arguments(plan: Path, out: Path, *more: str) -> list[str]:
    return ["run", "--building", str(plan), "--out", str(out), *more]


def parsed(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return parser.parse_args(["--building", "x.building.yaml", "--out", "runs", *words])


def test_the_program_makes_what_is_missing(
    tmp_path: Path, plan: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = arguments(plan, tmp_path / "o", "--seeds", "2", "--setup", "map_star", "smart")
    assert navigation_experiment.main([*words, "--goals", "2"]) == 0
    told = capsys.readouterr().err
    assert "4/4 corridor_L1,goals=2 " in told
    made = {path: path.stat().st_mtime_ns for path in (tmp_path / "o").rglob("*.mcap")}

    assert navigation_experiment.main([*words, "--goals", "2", "--series", "fixed"]) == 0
    assert "4 of 4 runs are there already" in capsys.readouterr().err
    assert made == {path: path.stat().st_mtime_ns for path in (tmp_path / "o").rglob("*.mcap")}


FINISHED, HALF_MADE = "*/*/[!.]*/belief/metadata.yaml", "*/*/.making_*/belief"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("end", "when"),
    [(signal.SIGKILL, FINISHED), (signal.SIGKILL, HALF_MADE), (signal.SIGINT, FINISHED)],
)
def test_killed_and_resumed_gives_the_same_bytes_and_tables(
    tmp_path: Path, plan: Path, end: int, when: str
) -> None:
    """
    Two processes at work, killed as the first run is being made, or is there: nothing half made
    has a name, and the same command makes the rest as if nothing had been; so does one process.
    """
    options = ["--seeds", "3", "--setup", "no_map", "map_star", "--goals", "40", "--jobs", "2"]
    out = tmp_path / "killed"
    process = subprocess.Popen(
        [sys.executable, PROGRAM, *arguments(plan, out, *options)], start_new_session=True,
        env=os.environ, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    wait_for(when, out, process)
    os.killpg(process.pid, end)
    told = process.communicate()[1]
    if end == signal.SIGINT:
        assert process.returncode == 130
        assert told.endswith("stopped; the same command goes on\n")
        assert "Traceback" not in told
        assert not list(out.rglob(".making_*"))
    there = {path for path in out.glob("*/*/*") if not path.name.startswith(".")}
    assert (when == FINISHED) <= len(there) < 6
    assert all(read_run(folder).goals for folder in there)

    subprocess.run([sys.executable, PROGRAM, *arguments(plan, out, *options)], check=True)
    whole = tmp_path / "whole"
    run_all(list(tasks_of(parsed_run(plan, whole, options))), whole, jobs=1)
    assert files(out) == files(whole)
    tables = [tables_of(read_runs([each])) for each in (out, whole)]
    assert [table.text() for table in tables[0]] == [table.text() for table in tables[1]]


@pytest.mark.slow
def test_a_process_that_is_ended_from_outside_is_told(tmp_path: Path, plan: Path) -> None:
    """
    In one line, in place of waiting for it for ever.
    """
    out = tmp_path / "o"
    words = arguments(plan, out, "--seeds", "9", "--setup", "no_map", "--goals", "40")
    process = subprocess.Popen(
        [sys.executable, PROGRAM, *words, "--jobs", "2"], stderr=subprocess.PIPE, text=True
    )
    wait_for(FINISHED, out, process)
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    workers = [
        pid for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
    ]
    os.kill(int(workers[-1]), signal.SIGKILL)
    told = process.communicate(timeout=60)[1]
    assert process.returncode == 1
    assert "a process of the experiment was ended from outside" in told
    assert "Traceback" not in told


def wait_for(pattern: str, out: Path, process: subprocess.Popen[str]) -> None:
    while process.poll() is None and not any(out.glob(pattern)):
        time.sleep(0.02)


def parsed_run(plan: Path, out: Path, options: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return parser.parse_args(arguments(plan, out, *options)[1:])


def test_a_sweep_is_each_value_with_each() -> None:
    tasks = list(tasks_of(parsed(
        "--near-m", "1", "3", "8", "--base", "0", "0.02", "--setup", "map", "--seeds", "4..5"
    )))  # fmt: skip
    assert len(tasks) == 12
    assert {task.seed for task in tasks} == {4, 5}
    assert {task.key.building for task in tasks} == {
        "x_L1", "x_L1,near_m=1.0", "x_L1,near_m=8.0",
        "x_L1,base=0.0", "x_L1,near_m=1.0,base=0.0", "x_L1,near_m=8.0,base=0.0",
    }  # fmt: skip


def test_every_option_can_be_said() -> None:
    assert HELP.keys() == {option.name for option in fields(RunOptions)}
    assert parsed("--recovery-clears").recovery_clears
    assert not parsed().recovery_clears


@pytest.mark.parametrize(
    ("text", "expected"), [("3", range(1, 4)), ("5..8", range(5, 9)), ("0..0", range(1))]
)
def test_seeds(text: str, expected: range) -> None:
    assert seeds(text) == expected


@pytest.mark.parametrize("text", ["0", "8..5", "-3", "x", ""])
def test_no_seeds(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match=r"expected N or A\.\.B"):
        seeds(text)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"reading": "loud"}, "reading: expected prose or literal, got 'loud'"),
        ({"base": 1.5}, "base: expected 0 to 1, got 1.5"),
        ({"goals": 0}, "goals: expected 1 or more, got 0"),
        ({"near_m": -1.0}, "near_m: expected 0 or more, got -1"),
        ({"near_m": math.nan}, "near_m: expected 0 or more, got nan"),
        ({"sense_m": 0.0}, "sense_m: expected more than 0, got 0"),
    ],
)
def test_what_makes_no_sense(options: dict[str, object], words: str) -> None:
    with pytest.raises(OptionError, match=words):
        RunOptions(**options)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--level", "7"], "expected one of the levels"),
        (["--building", "no.building.yaml"], "no.building.yaml"),
        (["--base", "2"], "base: expected 0 to 1, got 2"),
    ],
)
def test_an_error_is_one_line(
    tmp_path: Path, plan: Path, words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert navigation_experiment.main(arguments(plan, tmp_path / "o", *words)) == 1
    error = capsys.readouterr().err
    assert error.startswith("navigation_experiment: ")
    assert told in error
    assert error.count("\n") == 1
    assert not (tmp_path / "o").exists()
