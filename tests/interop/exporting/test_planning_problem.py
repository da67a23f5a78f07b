"""A log as a planning problem: of any moment, written whole, solved by planners of others."""

from __future__ import annotations

import importlib
import json
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs import probabilities
from semmap_log.cli import main
from semmap_log.errors import CommandError, OutputError
from semmap_log.interop.exporting.log_files import export
from semmap_log.interop.formats.files.pddl import Wishes, pass_cost
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.replay.replay import Scope
from tests.pddl import expression_of

Run = Callable[..., tuple[int, str, str]]
DAYS = [f"2026-03-{day:02d}" for day in range(1, 29)]


@pytest.fixture(scope="module")
def office(tmp_path_factory: pytest.TempPathFactory) -> DoorLog:
    """Two ways to the lab: by `rare`, nearly never open, and by `sure`, nearly always.

    Both are CLOSED at the end, which is half a day later. Beyond the lab lies the store.
    """
    path = tmp_path_factory.mktemp("planning") / "office"
    with sl.create(path, tz="UTC", compact=False) as log:
        log.add_door(name="rare", state="closed", at=DAYS[0])
        log.add_door(name="sure", state="closed", at=DAYS[0])
        log.add_door(name="Store (old)", state="moving", at=DAYS[0])
        log.add_door(name="gone", state="open", at=DAYS[0])
        for name in ("rare", "sure"):
            log.annotate(name, "rooms", "lobby,CoE lab", at=DAYS[0])
        log.annotate("Store (old)", "rooms", "CoE lab,Store", at=DAYS[0])
        for day in DAYS[:-1]:
            for hour in (8, 10, 12, 14, 20):
                log.observe("rare", "closed", at=f"{day}T{hour:02d}:00")
                log.observe("sure", "closed" if hour == 20 else "open", at=f"{day}T{hour:02d}:00")
        log.observe("sure", "closed", at=f"{DAYS[0]}T09:00")  # told late
        log.remove_door("gone", at=f"{DAYS[-1]}T12:00")
    return sl.read(path)


def written(log: DoorLog, folder: Path, scope: Scope = Scope(), **wishes: Any) -> tuple[Path, Path]:
    """Return the files of a domain and a problem."""
    domain, problem = folder / "domain.pddl", folder / "problem.pddl"
    export(log, problem, scope, domain=domain, wishes=Wishes(**wishes))
    return domain, problem


def facts(problem: Path) -> list[Any]:
    found = expression_of(problem.read_text(encoding="ascii"))
    return next(part[1:] for part in found if part[0] == ":init")


def test_costs_are_what_probabilities_says_at_that_moment(office: DoorLog, tmp_path: Path) -> None:
    """And states those of the map then; a door that came later, or went before, is not there."""
    early = office.scope(f"{DAYS[3]}T13:00")
    for scope in (Scope(), early):
        _, problem = written(office, tmp_path, scope)
        said = probabilities(office, at=None if scope is not early else early.at_ns)

        costs = {f[1][1]: int(f[2]) for f in facts(problem) if f[0] == "=" and len(f[1]) == 2}

        assert len(said) == len(costs) == (4 if scope is early else 3)
        assert {pass_cost(each.p_open) for each in said} == set(costs.values())
        assert (["open", "sure"] in facts(problem)) is (scope is early)
        assert costs["sure"] < costs["rare"]


@pytest.mark.parametrize("event", [3, 41])
def test_up_to_an_event_what_came_later_counts_for_nothing(
    office: DoorLog, event: int, tmp_path: Path
) -> None:
    """Neither for states nor for what is likely."""
    with sl.create(tmp_path / "part", tz="UTC", compact=False) as log:
        for entry in list(office.history())[: event + 1]:
            log.append([entry.event])
    part = sl.read(tmp_path / "part")

    _, problem = written(office, tmp_path, Scope(event=event))
    whole = [line for line in problem.read_text().splitlines() if not line.startswith(";")]
    export(part, tmp_path / "problem.pddl")

    assert whole == [
        line
        for line in (tmp_path / "problem.pddl").read_text().splitlines()
        if not line.startswith(";")
    ]


def test_the_same_question_gives_the_same_bytes(office: DoorLog, tmp_path: Path) -> None:
    """Also from another object, after the log was opened anew."""
    first = [path.read_bytes() for path in written(office, tmp_path, goal="sure")]

    again = written(sl.read(office.path), tmp_path, goal="sure")

    assert first == [path.read_bytes() for path in again]


def test_what_is_not_known_is_said_and_may_be_set(tmp_path: Path) -> None:
    """By the door's name; without --default-prob it is what `probabilities` says all the same."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(name="front")
        any_door = probabilities(log)[0].p_open

        done = export(log, tmp_path / "p.pddl")
        text = (tmp_path / "p.pddl").read_text()
        set_to = export(log, tmp_path / "q.pddl", default_prob=0.25)

    assert (
        "P(open) of 1 door (front) rests on too little; --default-prob P sets one" == done.notes[0]
    )
    assert "way leads through 1 door" in done.notes[1]
    assert "no goal" in done.notes[2]
    assert (
        f"(pass-cost front) {pass_cost(any_door)}) ; P(open) {any_door:.4f}, by too little" in text
    )
    assert "P(open) of 1 door (front) is 0.25, by --default-prob" == set_to.notes[0]
    assert f"(pass-cost front) {pass_cost(0.25)})" in (tmp_path / "q.pddl").read_text()


@pytest.mark.parametrize("default_prob", [-0.1, 1.5, math.nan])
def test_a_default_that_is_no_probability_is_refused(
    office: DoorLog, default_prob: float, tmp_path: Path
) -> None:
    """And nothing is written."""
    with pytest.raises(CommandError, match="from 0 to 1"):
        export(office, tmp_path / "p.pddl", default_prob=default_prob)

    assert [] == list(tmp_path.iterdir())


def test_both_files_are_written_or_none(office: DoorLog, tmp_path: Path) -> None:
    """A goal that is none leaves what was there, and so does a domain that cannot be written."""
    domain, problem = tmp_path / "domain.pddl", tmp_path / "problem.pddl"
    for path in (domain, problem):
        path.write_text("old")

    with pytest.raises(CommandError, match="goal 'cellar'"):
        export(office, problem, domain=domain, wishes=Wishes(goal="cellar"))
    with pytest.raises(OutputError, match="nowhere"):
        export(office, problem, domain=tmp_path / "nowhere" / "domain.pddl")
    with pytest.raises(CommandError, match="expected two files"):
        export(office, problem, domain=problem)
    with pytest.raises(OutputError, match="log's own folder"):
        export(office, problem, domain=office.path / "domain.pddl")

    assert ["old", "old"] == [path.read_text() for path in (domain, problem)]
    assert {"domain.pddl", "problem.pddl"} == {path.name for path in tmp_path.iterdir()}


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Run a verb."""

    def run(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stopped:
            main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return int(stopped.value.code or 0), captured.out, captured.err

    return run


def test_the_command_says_what_it_wrote_and_what_to_know(
    office: DoorLog, run: Run, tmp_path: Path
) -> None:
    """On stderr: stdout is for outputs."""
    problem = tmp_path / "problem.pddl"

    done = run("export", office.path, problem, "--domain", tmp_path / "domain.pddl",
               "--goal", "CoE lab", "--strips")  # fmt: skip

    assert (0, "") == done[:2]
    assert done[2].endswith(f"{problem}: 3 doors, 3 rooms.\n")
    assert "no start: --start ROOM" in done[2]
    assert "rests on too little" not in done[2]  # nothing is made of it
    assert "pass-cost" not in problem.read_text() + (tmp_path / "domain.pddl").read_text()


def test_a_machine_gets_the_notes_too(office: DoorLog, run: Run, tmp_path: Path) -> None:
    """In the one JSON document, and nowhere else."""
    code, out, err = run("export", office.path, tmp_path / "problem.pddl", "--strips", "--json")

    assert (0, "") == (code, err)
    assert ["no goal", "no start"] == [note.split(":")[0] for note in json.loads(out)["notes"]]


@pytest.mark.parametrize(
    "option", [["--goal", "x"], ["--start", "x"], ["--domain", "d"], ["--strips"]]
)
def test_options_of_pddl_are_refused_elsewhere(
    office: DoorLog, run: Run, option: list[str], tmp_path: Path
) -> None:
    """Else who misspells a name believes that they did something."""
    code, _, said = run("export", office.path, tmp_path / "doors.geojson", *option)

    assert 2 == code
    assert option[0] in said
    assert "only for .pddl" in said


AWKWARD = ["Open", "not", "Tür", "tür", "101", "", 'a" b)', "x\n(open x)", "门", "total-cost"]


@pytest.fixture
def awkward(tmp_path: Path) -> DoorLog:
    """A log with names that mean something elsewhere: doors in a row, each into the next room."""
    with sl.create(tmp_path / "awkward", tz="UTC", compact=False) as log:
        for n, name in enumerate(AWKWARD):
            number = log.add_door(name=name or None, state=["open", "closed", "offline"][n % 3])
            log.annotate(number, "rooms", f"{AWKWARD[n - 1] or 'hall'},{name or 'hall'}")
    return sl.read(tmp_path / "awkward")


def test_pyperplan_finds_the_way(office: DoorLog, awkward: DoorLog, tmp_path: Path) -> None:
    """It knows STRIPS and types alone."""
    pytest.importorskip("pyperplan", reason="pip install pyperplan")

    there = _pyperplan(*written(office, tmp_path, start="lobby", goal="Store", with_costs=False))
    back = _pyperplan(
        *written(awkward, tmp_path, start="hall", goal="(robot-at room-101)", with_costs=False)
    )

    assert 2 == len(there)
    assert there[0] in {f"(wait-and-pass {door} lobby coe-lab)" for door in ("rare", "sure")}
    assert "(try-and-pass store-old coe-lab store)" == there[1]
    assert 1 == len(back)
    assert "room-101" in back[0]


def test_pyperplan_reads_a_log_without_doors(tmp_path: Path) -> None:
    """Nothing is to be done, and nothing is the plan."""
    pytest.importorskip("pyperplan", reason="pip install pyperplan")
    with sl.create(tmp_path / "log", tz="UTC") as log:
        files = written(log, tmp_path, with_costs=False)

    assert [] == _pyperplan(*files)


def _pyperplan(domain: Path, problem: Path) -> list[str]:
    plan = problem.with_name("problem.pddl.soln")
    plan.unlink(missing_ok=True)
    done = subprocess.run(
        [sys.executable, "-m", "pyperplan", domain, problem], capture_output=True, text=True,
        check=False, cwd=problem.parent,
    )  # fmt: skip
    assert 0 == done.returncode, done.stdout + done.stderr
    return plan.read_text().splitlines() if plan.exists() else []


def _unified_planning(domain: Path, problem: Path) -> tuple[Any, Any]:
    """Return a problem as unified-planning reads it, and its best plan by Fast Downward."""
    shortcuts = importlib.import_module("unified_planning.shortcuts")
    reader = importlib.import_module("unified_planning.io").PDDLReader()
    shortcuts.get_environment().credits_stream = None
    read = reader.parse_problem(str(domain), str(problem))
    with shortcuts.OneshotPlanner(name="fast-downward-opt") as planner:
        planner.skip_checks = True
        return read, planner.solve(read)


def test_fast_downward_takes_the_likeliest_way(
    office: DoorLog, awkward: DoorLog, tmp_path: Path
) -> None:
    """Not the first one, and what it costs tells how likely all doors on it are open."""
    needed = "pip install unified-planning up-fast-downward"
    pytest.importorskip("unified_planning", reason=needed)
    pytest.importorskip("up_fast_downward", reason=needed)
    p_open = {each.door.name: each.p_open for each in probabilities(office)}
    domain, problem = written(office, tmp_path, start="lobby", goal="Store")

    read, solved = _unified_planning(domain, problem)

    assert "SOLVED_OPTIMALLY" == solved.status.name
    assert ["wait-and-pass(sure, lobby, coe-lab)", "try-and-pass(store-old, coe-lab, store)"] == [
        str(action) for action in solved.plan.actions
    ]
    costs = {
        str(door): int(str(cost))
        for door, cost in read.initial_values.items()
        if "cost" in str(door)
    }
    total = costs["pass-cost(sure)"] + costs["pass-cost(store-old)"]
    assert math.exp(-total / 1000) == pytest.approx(
        p_open["sure"] * p_open["Store (old)"], rel=2e-3
    )
    awkward_read, awkward_solved = _unified_planning(
        *written(awkward, tmp_path, start="hall", goal="(robot-at room-101)")
    )
    assert 1 == len(awkward_solved.plan.actions)
    assert len(AWKWARD) == sum(str(each.type) == "door" for each in awkward_read.all_objects)
