"""`semmap-log fleet`: tables for people, documents for programs, exit codes."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.csv
import pyarrow.parquet
import pytest

from tests.verbs import Refuses, run


def test_a_table_and_a_line_of_outcomes(
    made_fleet: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert 0 == run("fleet", "map", made_fleet, "--engine", "serial")

    out, err = capsys.readouterr()
    assert out.splitlines()[0].split("\t")[:3] == ["log", "door_id", "door"]
    assert "8 logs: 8 ok" in err


@pytest.mark.parametrize("timeout", ["0s", "soon"])
def test_a_timeout_is_some_time(
    made_fleet: Path, timeout: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("fleet", "map", made_fleet, "--timeout", timeout) in (1, 2)

    assert timeout in capsys.readouterr().err


def test_json_has_each_log_and_each_row(
    made_fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["info", str(made_fleet), str(tmp_path / "away"), "--engine", "serial"]

    assert 4 == run("fleet", *words, "--json")

    told = json.loads(capsys.readouterr().out)
    assert (9, 8) == (len(told["logs"]), len(told["rows"]))
    (gone,) = (log for log in told["logs"] if log["outcome"] != "ok")
    assert ("gone", str(tmp_path / "away")) == (gone["outcome"], gone["log"])
    assert "no such" in gone["text"].lower() or "expected" in gone["text"]


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_rows_as_a_file(made_fleet: Path, tmp_path: Path, suffix: str) -> None:
    out = tmp_path / f"openings.{suffix}"

    assert 0 == run("fleet", "openings", made_fleet, "--out", out, "--engine", "serial")

    table = pyarrow.csv.read_csv(out) if suffix == "csv" else pyarrow.parquet.read_table(out)
    assert {"log", "log_id", "door", "hour", "openings"} <= set(table.column_names)
    assert 8 == len(set(table["log_id"].to_pylist()))


def test_a_projection_of_ones_own(made_fleet: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fold = "tests.fleet.jobs.projections:Sightings"
    words = ["fold", str(made_fleet), "--fold", fold, "--engine", "serial", "--json"]

    assert 0 == run("fleet", *words)

    told = json.loads(capsys.readouterr().out)
    assert {"1", "2", "3"} == told["rows"][0]["state"].keys()


def test_command_lines_that_cannot_be(made_fleet: Path, refuses: Refuses) -> None:
    refuses(f"""
        fleet fold {made_fleet}
        fleet export {made_fleet}
        fleet openings {made_fleet} --at now
        fleet map {made_fleet} --out x.txt
        fleet dance {made_fleet}
    """)


@pytest.mark.parametrize("fold", ["nowhere:Nothing", "json:dumps", "plain"])
def test_a_projection_that_is_none(
    made_fleet: Path, capsys: pytest.CaptureFixture[str], fold: str
) -> None:
    assert 1 == run("fleet", "fold", made_fleet, "--fold", fold, "--engine", "serial")
    assert f"--fold {fold}: " in capsys.readouterr().err


def test_ctrl_c_keeps_what_has_answered(made_fleet: Path, tmp_path: Path) -> None:
    """The next run asks only the rest, and its answer is that of a run that was never stopped."""
    kept = tmp_path / "r"
    words = [sys.executable, "-m", "semmap_log", "fleet", "openings", made_fleet, "--results", kept]
    slow = [*words[:1], "-c", _SLOWLY, *words[3:]]
    with subprocess.Popen(slow, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        deadline = time.monotonic() + 60
        while len(list(kept.rglob("*.answer"))) < 3 and time.monotonic() < deadline:
            time.sleep(0.02)
        run.send_signal(signal.SIGINT)
        _, err = run.communicate(timeout=60)

    assert 130 == run.returncode, err
    assert "run the command again to continue" in err
    had = len(list(kept.rglob("*.answer")))
    assert 3 <= had < 8
    again = subprocess.run([*words, "--json"], capture_output=True, check=True)
    told = json.loads(again.stdout)
    assert had == sum(log["is_kept"] for log in told["logs"])
    whole = subprocess.run(
        [*words[:-1], tmp_path / "r2", "--json"], capture_output=True, check=True
    )
    assert json.loads(whole.stdout)["rows"] == told["rows"]


_SLOWLY = """
import sys, time
from semmap_log.fleet.jobs import door_jobs
from semmap_log.cli import main
keep = door_jobs.KeptAnswers.keep
def slowly(self, answer):
    keep(self, answer)
    time.sleep(0.3)
door_jobs.KeptAnswers.keep = slowly
sys.exit(main([*sys.argv[1:], "--engine", "serial"]))
"""


def test_without_its_packages_it_says_how_to_get_them(made_fleet: Path) -> None:
    for missing in ("pyarrow", "distributed"):
        program = (
            f"import sys; sys.modules[{missing!r}] = None\n"
            f"from semmap_log.cli import main; main(['fleet', 'map', {str(made_fleet)!r}])"
        )
        done = subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=False
        )

        assert 1 == done.returncode
        assert f"{missing} is not installed; install it with: pip install 'semmap-log[fleet]'" in (
            done.stderr
        )
