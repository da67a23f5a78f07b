"""`patrol-plan` and `go` as a user types them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.analysis.planning.ward import HALL, ward
from tests.verbs import run

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


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("patrol-plan", "LOG", "--budget", "0s"), 1, "budget: expected"),
        (("patrol-plan", "LOG", "--budget", "soon"), 1, "a length of time"),
        (("patrol-plan", "LOG", "--from", "500,1,1"), 1, "outside of the floor plan"),
        (("patrol-plan", "LOG", "--all", "--rooms", "1"), 2, "--all"),
        (("patrol-plan", "LOG", "--plot", "plan.gif"), 2, ".png or .svg"),
        (("patrol-plan", "LOG", "--doors", "gate"), 1, "gate"),
        (("go", "LOG", HALL, "0,0,2"), 1, "no way leads"),
        (("go", "LOG", HALL, "lab", "--speed", "1e-300"), 1, "speed: expected"),
        (("go", "LOG", HALL, "-1,1,1"), 1, "TO: (-1, 1) on level 1 is outside of the floor plan"),
        (("go", "LOG", "-.5,1,1", HALL), 1, "FROM: (-0.5, 1) on level 1 is outside"),
        (("go", "LOG", "-1", HALL), 2, "No such option"),
        (("go", "LOG", HALL, "lab", "--patience", "0"), 1, "patience: expected"),
        (("go", "LOG", HALL, "lab", "--patience", "x"), 1, "--patience: Expected a length"),
        (("patrol-plan", "LOG", "--speed", "1e-300"), 1, "speed: expected"),
        (("patrol-plan", "LOG", "--wait", "-1s"), 1, "--wait: Expected a length"),
        (("patrol-plan", "LOG", "--rooms", ""), 2, "--rooms"),
        (("patrol-plan", "LOG", "--doors", ","), 2, "--doors"),
        (("go", "LOG", HALL, "lab", "--speed", "0"), 1, "speed: expected"),
    ],
)
def test_what_is_refused(
    log: str, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], code: int, said: str
) -> None:
    """In one line that says what was expected."""
    given = [log if one == "LOG" else one for one in arguments]

    assert run(*given) == code
    assert said in capsys.readouterr().err


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
