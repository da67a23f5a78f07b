"""`eval_doors.py` on a tiny set: the form of its document, zones, steps, errors."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from eval_doors import ESTIMATORS, _Set, step_of

from semmap_log.analysis.probabilities.belief_fold import ESTIMATORS as KNOWN

TOOL = Path(__file__).parents[2] / "eval_doors.py"
MODES = ["frozen", "daily", "lag_1h", "lag_6h", "lag_24h", "patrol_30m", "patrol_4h"]
THERE = [name for name in ESTIMATORS if name in KNOWN]


def tiny(folder: Path, *, every_min: int = 1) -> Path:
    """Return a set of a door that is open from nine to five, on six days."""
    folder.mkdir()
    minutes = [60 * 9 + (7 if every_min == 1 else 0), 60 * 17]
    rows = ["timestamp,door,state", "2026-01-01T00:00:00,front,CLOSED"]
    for day in range(1, 7):
        for minute, state in zip(minutes, ("OPEN", "CLOSED"), strict=True):
            rows.append(f"2026-01-{day:02}T{minute // 60:02}:{minute % 60:02}:00,front,{state}")
    (folder / "doors.csv").write_text("\n".join(rows) + "\n")
    (folder / "obs_windows.csv").write_text(
        "door,start,end\nfront,2026-01-01T00:00:00,2026-01-06T23:00:00\n"
    )
    return folder


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(TOOL), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_document_has_the_promised_form(tmp_path: Path) -> None:
    """
    Set -> mode -> estimator -> the four figures.
    """
    asked = [part for name in THERE for part in ("--estimator", name)]

    done = run(tiny(tmp_path / "one"), tiny(tmp_path / "two"), "--json", "--seeds", "2", *asked)

    found = json.loads(done.stdout)
    assert 0 == done.returncode
    assert ["one", "two"] == list(found)
    assert MODES == list(found["one"])
    for modes in found.values():
        for estimators in modes.values():
            assert THERE == list(estimators)
            for figures in estimators.values():
                assert ["brier", "log_loss", "ece", "bias"] == list(figures)
                assert all(isinstance(value, float) for value in figures.values())
    assert found["one"] == found["two"]
    assert found["one"]["frozen"]["hour_of_day"]["brier"] < 0.01
    assert found["one"]["lag_24h"]["last"]["brier"] < 0.01


def test_without_arguments_all_estimators_are_judged() -> None:
    """
    The eight that the document promises are there.
    """
    assert 8 == len(ESTIMATORS)
    assert set(ESTIMATORS) <= set(KNOWN)


@pytest.mark.slow
def test_tables_say_when_and_how(tmp_path: Path) -> None:
    """
    A table a mode, as Markdown, with the command; the best figure is bold.
    """
    done = run(
        tiny(tmp_path / "one"), "--estimator", "constant", "--estimator", "hour_of_day",
        "--tz", "one=Europe/Vienna", "--figure", "ece", "--seeds", "2",
    )  # fmt: skip

    assert 0 == done.returncode
    assert "tools/experiments/eval_doors.py" in done.stdout
    assert "| patrol_4h | constant | hour_of_day |" in done.stdout
    assert done.stdout.count("| one | ") == len(MODES)
    assert "**" in done.stdout
    assert "one: 1 doors, 1 patrolled, a step of 60 s, Europe/Vienna" in done.stderr
    assert "minus" not in done.stdout, "the calibration error is no mean over days"


@pytest.mark.slow
def test_patrols_are_drawn_anew_with_each_seed(tmp_path: Path) -> None:
    """
    Figures are means over the seeds, with their standard error; the estimator under test is held
    against the other on the same seeds. The same again gives the same bytes.
    """
    details = tmp_path / "details.json"
    asked = [
        tiny(tmp_path / "one"), "--estimator", "constant", "--estimator", "hour_of_day",
        "--mode", "lag_24h", "--mode", "patrol_30m", "--seed", "3", "--seeds", "4",
        "--under-test", "hour_of_day", "--details", details,
    ]  # fmt: skip

    done = run(*asked)
    first = details.read_text()
    again = run(*asked)

    assert (0, done.stdout, first) == (again.returncode, again.stdout, details.read_text())
    patrol = json.loads(first)["one"]["patrol_30m"]
    known = json.loads(first)["one"]["lag_24h"]
    assert ([3, 4, 5, 6], []) == (patrol["seeds"], known["seeds"])
    brier = {name: found["brier"] for name, found in patrol["estimators"].items()}
    values = brier["constant"]["by_seed"]
    assert 4 == len(set(values))
    assert pytest.approx(np.mean(values)) == brier["constant"]["mean"]
    assert pytest.approx(np.std(values, ddof=1) / 2) == brier["constant"]["standard_error"]
    apart = np.subtract(brier["hour_of_day"]["by_seed"], values)
    pair = patrol["differences"]["constant"]["brier"]
    assert pytest.approx(np.mean(apart)) == pair["mean"]
    assert pytest.approx(np.std(apart, ddof=1) / 2) == pair["standard_error"]
    assert known["estimators"]["constant"]["brier"]["standard_error"] is None
    assert known["differences"]["constant"]["brier"]["standard_error"] > 0
    mean, error = brier["constant"]["mean"], brier["constant"]["standard_error"]
    assert f"{mean:.4f} ± {error:.4f}" in done.stdout
    assert "seeds 3, 4, 5, 6" in done.stdout
    assert "| patrol_30m: hour_of_day minus | constant |" in done.stdout


@pytest.mark.slow
def test_a_peer_joins_the_table(tmp_path: Path) -> None:
    """
    On the same forecasts and seeds as ours: after one day's habit the chained filters know a door.
    """
    done = run(
        tiny(tmp_path / "one"), "--estimator", "constant", "--mode", "patrol_30m", "--seeds", "2",
        "--peer", f"chained={sys.executable} {TOOL.parent / 'door_peers' / 'chained.py'}", "--json",
    )  # fmt: skip

    found = json.loads(done.stdout)["one"]["patrol_30m"]
    assert 0 == done.returncode
    assert ["constant", "chained"] == list(found)
    assert found["chained"]["brier"] < 0.5 * found["constant"]["brier"]


PERPETUA = os.environ.get("SEMMAP_LOG_PERPETUA", "")
"""The command of `tools/experiments/door_peers/perpetua.py` in a Python of its own."""


@pytest.mark.slow
@pytest.mark.skipif(not PERPETUA, reason="SEMMAP_LOG_PERPETUA names no command of Perpetua")
def test_perpetua_joins_the_table(tmp_path: Path) -> None:
    """
    Where it is installed: after visits, and an hour ahead.
    """
    done = run(
        tiny(tmp_path / "one"), "--estimator", "constant", "--mode", "patrol_30m", "--mode",
        "lag_1h", "--seeds", "1", "--step", "600", "--peer", f"perpetua={PERPETUA}", "--json",
    )  # fmt: skip

    found = json.loads(done.stdout)["one"]
    assert 0 == done.returncode
    for mode in ("patrol_30m", "lag_1h"):
        assert found[mode]["perpetua"]["brier"] < 0.5 * found[mode]["constant"]["brier"]


def test_the_step_goes_by_how_fine_the_times_are(tmp_path: Path) -> None:
    """
    Times on whole hours were polled: ten minutes are fine enough; else a minute.
    """
    fine, coarse = tiny(tmp_path / "fine"), tiny(tmp_path / "coarse", every_min=60)

    steps = [step_of(_Set.of(folder)) for folder in (fine, coarse)]

    assert [60.0, 600.0] == steps


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere"], "nowhere: expected a folder with doors.csv.gz and obs_windows.csv"),
        (["one", "one"], "expected different names"),
        (["one", "--tz", "two=UTC"], "--tz: expected one of one, got 'two'"),
        (["one", "--tz", "Mars/Dust", "--estimator", "last"], "No time zone 'Mars/Dust'"),
        (["one", "--estimator", "nix"], "estimator 'nix'"),
        (
            ["one", "--peer", "nix"],
            "--peer: expected NAME=PROGRAM with a name of its own, got 'nix'",
        ),
        (["one", "--peer", "last=x"], "--peer: expected NAME=PROGRAM with a name of its own"),
        (["one", "--peer", "ghost=./no"], "peer ghost: cannot be started"),
        (["one", "--under-test", "nix"], "--under-test: expected one of count, "),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, arguments: list[str], said: str) -> None:
    """
    In one line, exit code 1.
    """
    tiny(tmp_path / "one")
    places = [tmp_path / a if a in ("one", "nowhere") else a for a in arguments]

    done = run(*places)

    assert 1 == done.returncode
    assert said in done.stderr
    assert "Traceback" not in done.stderr
