"""`evaluate` and `calibrate` as a user types them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.interop.importing.importing import import_file
from tests.verbs import Refuses, run

pytestmark = pytest.mark.usefixtures("terminal")


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the log `lab`: two doors over 20 days, front open from nine to five."""
    monkeypatch.chdir(tmp_path)
    rows = ["timestamp,door,state", "2026-01-01,front,CLOSED", "2026-01-01,side,CLOSED"]
    for day in range(1, 21):
        rows += [f"2026-01-{day:02}T09:00,front,OPEN", f"2026-01-{day:02}T17:00,front,CLOSED"]
    rows += ["2026-01-21,front,UNKNOWN", "2026-01-21,side,UNKNOWN"]
    Path("doors.csv").write_text("\n".join(rows) + "\n")
    with sl.create("lab", tz="Europe/Vienna") as log:
        import_file(log, Path("doors.csv"))
    return tmp_path


@pytest.fixture
def seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the log `seen`: a door that a robot saw each hour, wrong each tenth time."""
    monkeypatch.chdir(tmp_path)
    with sl.create("seen", tz="UTC") as log:
        log.add_door(name="front", at="2026-01-01T00:00Z")
        for n in range(60):
            state = "closed" if n % 10 == 0 else "open"
            at = f"2026-01-{1 + n // 24:02}T{n % 24:02}:30Z"
            log.observe("front", state, accuracy=0.8, at=at, source="lidar")
    return tmp_path


def test_the_table_fits_a_terminal_and_marks_the_best(
    lab: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """80 columns; means over doors, each door's Brier score, and what was known when."""
    code = run("evaluate", "lab", "--prequential")

    out = capsys.readouterr().out
    assert 0 == code
    assert max(map(len, out.splitlines())) <= 80
    assert re.search("^constant +0.1111", out, re.MULTILINE)
    assert "front" in out
    assert "2 doors, 17,280 samples after the first 70%; mean over doors, * best" in out
    assert "known at each forecast: all up to the midnight before it" in out
    assert 0 < out.count("*")


def test_the_document_has_all_of_it(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What was asked, the mean, each door, and the reliability diagram."""
    code = run(
        "evaluate", "lab", "--patrol", "1h", "--accuracy", "0.8", "--seed", "5", "--split", "0.5",
        "--step", "600", "--estimator", "constant", "--estimator", "fremen3", "--json",
    )  # fmt: skip

    found = json.loads(capsys.readouterr().out)
    assert 0 == code
    assert {"interval_s": 3600.0, "accuracy": 0.8, "seed": 5} == found["patrol"]
    assert (0.5, False, None, 600.0, "truth") == tuple(
        found[key] for key in ("split", "prequential", "horizon_s", "step_s", "against")
    )
    assert ["constant", "fremen3"] == list(found["mean"])
    assert ["brier", "log_loss", "ece", "bias"] == list(found["mean"]["constant"])
    assert [("front", 1440, 1440), ("side", 1440, 1440)] == [
        (door["name"], door["training"], door["tests"]) for door in found["doors"]
    ]
    counts = [row["count"] for row in found["reliability"]["constant"]]
    assert 2880 == sum(counts)
    mean = sum(door["scores"]["constant"]["brier"] for door in found["doors"]) / 2
    assert pytest.approx(mean) == found["mean"]["constant"]["brier"]


def test_one_door_may_be_asked_about(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By its name, at a horizon: an hour before, the state of a door that never opens is known."""
    code = run(
        "evaluate", "lab", "--door", "side", "--horizon", "1h", "--estimator", "last", "--json"
    )

    found = json.loads(capsys.readouterr().out)
    assert 0 == code
    assert ["side"] == [door["name"] for door in found["doors"]]
    assert 3600.0 == found["horizon_s"]
    assert found["mean"]["last"]["brier"] < 1e-5


def test_a_log_of_sightings_is_held_against_the_next_one(
    seen: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without a truth readings are forecast; and it says so."""
    code = run("evaluate", "seen", "--estimator", "constant")
    table = capsys.readouterr().out
    run("evaluate", "seen", "--estimator", "constant", "--json")
    document = json.loads(capsys.readouterr().out)

    assert 0 == code
    assert "1 door, 18 readings after the first 70%" in table
    assert "next_reading" == document["against"]


def test_what_cannot_be_is_said_in_one_line(lab: Path, refuses: Refuses) -> None:
    """Exit code 1 for what our library refuses, 2 for options that do not fit together."""
    refuses("""
        evaluate lab --estimator nix
        evaluate lab --estimator fremen85
        evaluate lab --split 1
        evaluate lab --horizon soon
        evaluate lab --since 2026-01-20T23:00
        evaluate lab --door attic
        evaluate lab --seed 3
        evaluate lab --accuracy 0.8
        evaluate lab --patrol 30m --accuracy 0.3
        evaluate lab --plot x.jpg
    """)


@pytest.mark.slow
def test_the_plot_is_a_picture(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A panel an estimator, with the counts; the words of an .svg can be searched."""
    pytest.importorskip("matplotlib")

    codes = [run("evaluate", "lab", "--plot", name) for name in ("c.png", "c.svg")]

    assert [0, 0] == codes
    assert b"\x89PNG" == Path("c.png").read_bytes()[:4]
    drawn = Path("c.svg").read_text(encoding="utf-8")
    assert "hour_of_week" in drawn
    assert "Forecast, and what came: lab, 2 doors" in drawn
    assert "17k" in drawn
    assert "c.svg: the reliability diagram." in capsys.readouterr().err


@pytest.mark.slow
def test_a_sensor_is_calibrated(seen: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """54 of 60 right while open; what to type then, and that closed was never seen."""
    Path("truth.csv").write_text(
        "timestamp,door,state\n2026-01-01T00:00Z,front,OPEN\n2026-01-09T00:00Z,front,OPEN\n"
    )

    code = run("calibrate", "seen", "--truth", "truth.csv", "--source", "lidar")
    out = capsys.readouterr().out
    run("calibrate", "seen", "--truth", "truth.csv", "--json")
    document = json.loads(capsys.readouterr().out)

    assert 0 == code
    assert max(map(len, out.splitlines())) <= 80
    assert "0.900 [0.8" in out
    assert "--accuracy-open 0.893" in out
    assert "never seen while closed" in out
    assert 60 == document["accuracy_open"]["visits"]
    assert pytest.approx(0.9) == document["doors"][0]["accuracy_open"]["accuracy"]
    assert document["accuracy_closed"]["accuracy"] is None


def test_windows_and_zones_say_when_a_truth_is_known(
    seen: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Twelve hours of it, in Vienna's time: an hour earlier in UTC."""
    Path("truth.csv").write_text("timestamp,door,state\n2026-01-01T00:00,front,OPEN\n")
    Path("windows.csv").write_text("door,start,end\nfront,2026-01-01T12:00,2026-01-02T00:00\n")

    code = run(
        "calibrate", "seen", "--truth", "truth.csv", "--windows", "windows.csv",
        "--tz", "Europe/Vienna", "--json",
    )  # fmt: skip

    found = json.loads(capsys.readouterr().out)
    assert 0 == code
    assert 12 == found["accuracy_open"]["visits"]
    assert pytest.approx(11 / 12) == found["accuracy_open"]["accuracy"]


def test_a_truth_of_a_stranger_is_refused(seen: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The file names a door that the log does not know."""
    Path("truth.csv").write_text("timestamp,door,state\n2026-01-01T00:00Z,attic,OPEN\n")

    code = run("calibrate", "seen", "--truth", "truth.csv")

    assert 1 == code
    assert "no door is called 'attic'" in capsys.readouterr().err
