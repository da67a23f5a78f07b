"""`best-time` as a user types it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.analysis.beliefs.patrolled import patrolled
from tests.verbs import run

pytestmark = pytest.mark.usefixtures("terminal")

RECORDINGS = Path(__file__).parents[2] / "recordings"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(patrolled(tmp_path_factory.mktemp("best-time") / "log").path)


def test_the_table_names_hours_and_what_is_left_out(
    log: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Concrete windows in local time, hours of the week, P(open) now, and the night."""
    code = run("best-time", log, "front", "--at", "2026-03-27T10:20", "-n", "168")

    out = capsys.readouterr().out
    assert 0 == code
    assert "Fri 2026-03-27 10:20 to " in out
    assert "in a typical week" in out
    assert "now, 2026-03-27 10:20:00 (Europe/Vienna): P(open) " in out
    assert "left out, never seen then: 20:00-07:00" in out
    assert max(map(len, out.splitlines())) <= 80


def test_one_json_document_has_it_all(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Windows in UTC with their local weekday and hour."""
    code = run("best-time", log, "front", "--at", "2026-03-22T20:30", "-n", "2", "--json")

    found = json.loads(capsys.readouterr().out)
    assert 0 == code
    assert ("front", "OPEN", True) == (found["name"], found["state"], found["is_known"])
    assert [2, 2] == [len(found["next"]), len(found["of_the_week"])]
    first = found["next"][0]
    assert "Mon" == first["weekday"]
    assert f"2026-03-23T{first['hour'] - 1:02}:00:00.000000000Z" == first["start"]


def test_a_door_never_seen_is_unknown(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    """In words, and to machines without windows."""
    codes = [run("best-time", log, "attic")]
    table = capsys.readouterr().out
    codes.append(run("best-time", log, "attic", "--json"))
    found = json.loads(capsys.readouterr().out)

    assert [0, 0] == codes
    assert "attic: UNKNOWN, never seen." in table
    assert (False, [], [], None) == (
        found["is_known"], found["next"], found["of_the_week"], found["wait_s"]
    )  # fmt: skip


@pytest.mark.parametrize("state", ["open", "closed"])
def test_a_long_name_fits(state: str, capsys: pytest.CaptureFixture[str]) -> None:
    """In the clinic, by either state: 80 columns."""
    code = run("best-time", str(RECORDINGS / "clinic_week"), "L1_left_consult_rm_13_outer",
               "--state", state)  # fmt: skip

    out = capsys.readouterr().out
    assert 0 == code
    assert f"L1_left_consult_rm_13_outer {state}, from now on" in out
    assert max(map(len, out.splitlines())) <= 80


def test_mistakes_are_named(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A door that there is not; a state that is none of the two."""
    codes = [run("best-time", log, "nope"), run("best-time", log, "front", "--state", "moving")]

    err = capsys.readouterr().err
    assert [1, 2] == codes
    assert "nope" in err
    assert "--state" in err
