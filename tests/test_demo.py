"""The demo is the first thing that a new user runs: it must work, twice, and tell the truth."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.demo import run_demo, shipped_recording
from semmap_log.errors import LogExistsError


def test_it_records_what_the_recording_holds(tmp_path: Path) -> None:
    """
    The new log knows the same, at the same times, as the recording without its retracted event.
    """
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
    """
    In the middle, one door is held open, one was just seen, and one not for two hours: UNKNOWN.
    """
    made = run_demo(tmp_path / "demo")

    main, coe, hardware = made.beliefs
    assert [True, True, False] == [main.is_known, coe.is_known, hardware.is_known]
    assert main.p_open > coe.p_open > 0.5
    assert made.moments[1].at_ns == main.known_ns == main.time_ns


@pytest.mark.slow
@pytest.mark.usefixtures("terminal")
def test_it_runs_twice_and_writes_over_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """
    A second run takes another folder; a folder that is named must be free.
    """
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
