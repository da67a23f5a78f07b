"""The demo is the first thing that a new user runs: it must work, twice, and tell the truth."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.cli.demonstration.demo import _truth, run_demo, shipped_recording
from semmap_log.errors import LogExistsError


def test_it_records_what_the_recording_holds(tmp_path: Path) -> None:
    """The new log knows the same, at the same times."""
    made = run_demo(tmp_path / "demo")
    source, log = sl.read(shipped_recording("office")), sl.read(made.log)

    for moment in ("09:00", "12:31", "13:30", "18:00", "20:00"):
        at, known_at = f"2026-03-02T{moment}", f"2026-03-02T{moment}:59"
        theirs, ours = source.replay(at, "2026-03-03"), log.replay(at, "2026-03-03")
        assert [d.state for d in theirs.doors.values()] == [d.state for d in ours.doors.values()]
        theirs, ours = source.replay(known_at=known_at), log.replay(known_at=known_at)
        assert [d.state for d in theirs.doors.values()] == [d.state for d in ours.doors.values()]
    assert made.copied + made.recorded == log.replay().event + 1
    assert made.yaml.read_text().startswith("1:\n  position:\n")
    assert made.costmap.read_bytes().startswith(b"\x89PNG")
    assert made.report.read_text().startswith("<!doctype html>")
    assert [False] == list({door_map.event == -1 for door_map in made.moments})


def test_it_says_what_it_does_not_know(tmp_path: Path) -> None:
    """In the middle, one door is held open, one was just seen, and one not for two hours."""
    made = run_demo(tmp_path / "demo")

    main, coe, hardware = made.beliefs
    assert [True, True, False] == [main.is_known, coe.is_known, hardware.is_known]
    assert main.p_open > coe.p_open > 0.5
    assert made.moments[1].at_ns == main.known_ns == main.time_ns


def test_it_sees_doors_by_laser_and_tells_the_truth_beside(tmp_path: Path) -> None:
    """Of the shipped bag: passages as often as the truth has them."""
    seen = run_demo(tmp_path / "demo").seen
    truth = json.loads((shipped_recording("office").parent / "office_scans.truth.json").read_text())

    through = sum(len(door["driven_through_s"]) for door in truth["doors"])
    assert through == sum(door.passed for door in seen.doors)
    sighted = [door for door in seen.doors if not door.passed]
    assert {"OPEN", "CLOSED"} == {door.said for door in sighted}
    still = [door for door in sighted if door.truth in {"OPEN", "CLOSED"}]
    assert len(still) >= 5
    assert all(door.said == door.truth for door in still)
    assert [door.happened_ns for door in seen.doors] == sorted(d.happened_ns for d in seen.doors)
    assert seen.log.name == "office_scans"
    assert len(sl.read(seen.log).replay().doors) == 3


@pytest.mark.parametrize(
    ("from_s", "to_s", "told"),
    [
        pytest.param(-5.0, 3.0, "OPEN", id="before the first move"),
        pytest.param(11.0, 11.5, "MOVING", id="while it moved"),
        pytest.param(5.0, 12.0, "OPEN, then CLOSED", id="over a change"),
        pytest.param(12.5, 30.0, "CLOSED", id="after it"),
    ],
)
def test_truth_of_a_while(from_s: float, to_s: float, told: str) -> None:
    """How a door stood over a while, moves left out."""
    rows = [
        {"from_s": 0.0, "state": "OPEN"},
        {"from_s": 10.0, "state": "MOVING"},
        {"from_s": 12.0, "state": "CLOSED"},
    ]

    assert told == _truth(rows, from_s, to_s)


@pytest.mark.slow
@pytest.mark.usefixtures("terminal")
def test_it_runs_twice_and_writes_over_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A second run takes another folder; a folder that is named must be free."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["semmap-log"])
    for _ in range(2):
        with pytest.raises(SystemExit) as left:
            main(["demo"])
        assert 0 == left.value.code
    out = capsys.readouterr().out

    assert {"demo", "demo-2"} == {path.name for path in tmp_path.iterdir()}
    assert "What to type next" in out
    assert "UNKNOWN" in out
    assert all(len(line) <= 80 for line in out.splitlines())
    with pytest.raises(LogExistsError, match="name another folder"):
        run_demo(tmp_path / "demo")
