"""`patrol-plan` and `go` as a user types them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.analysis.planning.ward import HALL, ward
from tests.verbs import Refuses, run

pytestmark = pytest.mark.usefixtures("terminal")

PLAN = ("--from", HALL, "--start", "2026-03-20T10:00")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(ward(tmp_path_factory.mktemp("plan") / "log").path)


def test_a_row_a_stop_and_what_is_left_out(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Order, arrival, P, why; below: the store, and what the plan rests on."""
    code = run("patrol-plan", log, *PLAN)

    out = capsys.readouterr().out
    assert code == 0
    assert "10:00:0" in out
    assert "lab" in out
    assert "likely open" in out
    assert "left out: store: shut at" in out
    assert "mean time to visit" in out
    assert max(map(len, out.splitlines())) <= 80


def test_the_plan_as_json(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    """One document: stops in order, what is left out, and by which options."""
    code = run("patrol-plan", log, *PLAN, "--budget", "30min", "--rooms", "lab,store", "--json")

    found = json.loads(capsys.readouterr().out)
    assert code == 0
    assert [stop["door"] for stop in found["stops"]] == ["lab"]
    assert found["stops"][0]["stop"] == 1
    assert [each["reason"] for each in found["left_out"]] == ["shut"]
    assert found["budget_s"] == 1800
    assert found["start"] == "2026-03-20T09:00:00.000000000Z"


@pytest.mark.parametrize("name", ["plan.png", "plan.svg"])
def test_a_picture(log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    """The same bytes each time; said on stderr."""
    pictures = []
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        path = tmp_path / folder / name
        assert run("patrol-plan", log, *PLAN, "--plot", str(path)) == 0
        pictures.append(path.read_bytes())

    assert "stops." in capsys.readouterr().err
    assert pictures[0] == pictures[1]
    assert len(pictures[0]) > 5000


def test_what_is_refused(log: str, refuses: Refuses) -> None:
    """In one line that says what was expected."""
    refuses(f"""
        patrol-plan {log} --budget 0s
        patrol-plan {log} --budget soon
        patrol-plan {log} --from 500,1,1
        patrol-plan {log} --all --rooms 1
        patrol-plan {log} --plot plan.gif
        patrol-plan {log} --doors gate
        go {log} {HALL} 0,0,2
        go {log} {HALL} lab --speed 1e-300
        go {log} {HALL} -1,1,1
        go {log} -.5,1,1 {HALL}
        go {log} -1 {HALL}
        go {log} {HALL} lab --patience 0
        go {log} {HALL} lab --patience x
        patrol-plan {log} --speed 1e-300
        patrol-plan {log} --wait -1s
        patrol-plan {log} --rooms ''
        patrol-plan {log} --doors ,
        go {log} {HALL} lab --speed 0
    """)


def test_a_trip(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Each door with its choice; the expected time below; the same in JSON."""
    trip = ("go", log, HALL, "room:2", "--depart", "2026-03-20T10:00")
    codes = [run(*trip)]
    out = capsys.readouterr().out
    codes.append(run(*trip, "--patience", "10min", "--json"))
    found = json.loads(capsys.readouterr().out)

    assert codes == [0, 0]
    assert "expected time to the goal" in out
    assert "if shut" in out
    assert found["doors"][0]["if_shut"] in {"WAIT", "ROUND"}
    assert found["walk_s"] <= found["expected_s"] <= 600 + found["walk_s"] + 60


def test_no_seconds_need_no_unit(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    """0 is the same in all of them."""
    code = run("patrol-plan", log, *PLAN, "--wait", "0", "--enter", "0s", "--rooms", "lab")

    assert code == 0
    assert "1 stop, of which" in capsys.readouterr().out
