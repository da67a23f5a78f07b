"""`why` as a user types it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.cli import main
from tests.verbs import Refuses, run

pytestmark = pytest.mark.usefixtures("terminal")

OFFICE = str(Path(__file__).parents[2] / "recordings" / "office")
WIDEST = 80


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the log `lab`: what happened in March was imported years later."""
    monkeypatch.chdir(tmp_path)
    with sl.create("lab", tz="UTC") as log:
        door = log.add_door(name="front", at="2020-03-01T08:00", actor="survey")
        log.observe(door, "open", accuracy=0.9, at="2020-03-01T09:00", source="front.csv")
        log.request(door, "closed", at="2020-03-01T09:05", actor="porter", reason="cold")
        log.passed(door, passed=False, at="2020-03-01T09:06", actor="tug1")
        log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, at="2020-03-01T10:00")
        log.remove_door(2, at="2020-03-01T11:00", reason="walled up")
    return tmp_path


def _rows(capsys: pytest.CaptureFixture[str]) -> dict[str, str]:
    """Return what is drawn: name -> value, folded lines joined, the notes left out."""
    found: dict[str, str] = {}
    name, lines = "", capsys.readouterr().out.splitlines()
    width = re.match(r"door\s+", lines[0]).end()  # type: ignore[union-attr]
    for line in lines:
        head, value = line[:width].strip(), line[width:].strip()
        name = head or name
        found[name] = f"{found[name]} {value}" if name in found else value
    return found


@pytest.mark.parametrize("width", [40, WIDEST, 100])
def test_it_fits_one_screen(
    width: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is cut, at any width."""
    monkeypatch.setenv("COLUMNS", str(width))

    code = run("why", OFFICE, "main_door", "--at", "10:30")

    out = capsys.readouterr().out
    assert 0 == code
    assert max(map(len, out.splitlines())) <= width
    assert width < WIDEST or len(out.splitlines()) <= 24
    assert "it was open: sun on the glass" in " ".join(out.split())


def test_what_was_told_years_later(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Then nothing was believed; what is true rests on the import, and nobody peeks."""
    code = run("why", "lab", "front", "--at", "2020-03-01T09:10")

    rows = _rows(capsys)
    assert 0 == code
    assert rows["true"].startswith("OPEN since 09:00:00, for 10 minutes")
    assert "with front.csv" in rows["begun by"]
    assert "nothing: no event had been recorded by then" == rows["believed"]
    assert rows["because"].startswith("event 2 was recorded later, at 20")
    assert "event 3: asked to be CLOSED" in rows["other reports"]
    assert "by porter: cold" in rows["other reports"]
    assert "event 4: given up" in rows["other reports"]
    assert "UNKNOWN: the door was not known then" == rows["P(open)"]


def test_a_door_without_a_name_that_was_removed(
    lab: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is called by its number; before it was added it was not there, and after it is gone."""
    found = []
    for when in ("09:30", "10:30", "12:00"):
        assert 0 == run("why", "lab", "2", "--at", f"2020-03-01T{when}")
        found.append(_rows(capsys))
    before, between, after = found

    assert "not yet in the map" == before["true"]
    assert before["next change"].startswith("UNKNOWN at 10:00:00, 30 minutes later; event 5: added")
    assert between["true"].startswith("UNKNOWN since 10:00:00")
    assert between["next change"].startswith(
        "removed at 11:00:00, 30 minutes later; event 6: removed"
    )
    assert after["true"].startswith("removed at 11:00:00, 1 hour before")
    assert "walled up" in after["begun by"]
    assert after["next change"].startswith("not known: the log ends 1 hour before")


def test_now_is_told_once(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What is known is believed: no second state."""
    assert 0 == run("why", "lab", "front")

    rows = _rows(capsys)
    assert "1 (front), unplaced" == rows["door"]
    assert "believed" not in rows
    assert rows["next change"].startswith("none up to the log's end")


def test_a_pipe_gets_a_row_a_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Name and value, whole times, a name for each."""
    monkeypatch.setattr("semmap_log.cli.sanitized_streams.is_for_people", lambda: False)

    assert 0 == run("why", OFFICE, "coe_door", "--at", "13:30")

    rows = dict(line.split("\t") for line in capsys.readouterr().out.splitlines())
    assert "OPEN since 2026-03-02 13:10:00+01:00, for 20 minutes" == rows["true"]
    assert "event 122 was recorded later" in rows["believed: because"]


def test_json_has_all_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    """Events as `history` has them, P(open) as `probabilities` has it."""
    assert 0 == run("why", OFFICE, "main_door", "--at", "10:30", "--json")

    told: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert "2026-03-02T09:30:00.000000000Z" == told["at"] == told["known_at"]
    assert 75 == told["known_event"]
    assert ["OPEN", "CLOSED"] == [told[each]["state"] for each in ("true", "believed")]
    assert [58, 76] == [told["taken_back"]["event"], told["taken_back"]["retracted_by"]]
    assert [58] == [each["event"] for each in told["otherwise"]["events"]]
    assert ["facility manager"] == [each["actor"] for each in told["retractions"]]
    assert told["told_since"] is None
    assert told["belief"]["is_known"]
    assert ["CLOSED", 186] == [told["next"]["state"], told["next"]["event"]["event"]]


def test_what_cannot_be_asked(lab: Path, refuses: Refuses) -> None:
    """Says what was expected."""
    refuses("""
        why lab side
        why lab front --at noon-ish
        why lab front --near soon
        why lab front --at event:99
    """)


def test_events_before_the_adding_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No answer counts them, and who asks why hears of it, with what to do."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door(name="front")
        log.observe(door, "open", at="2026-01-02T10:00")

    with pytest.raises(SystemExit) as end:
        main(["why", str(tmp_path / "log"), "front", "--at", "2026-01-02T11:00"])

    assert not end.value.code
    said = capsys.readouterr()
    assert "not yet in the map" in said.out
    assert "happened before the door was added" in said.err
    assert "--since-ever" in said.err
