"""Reading works where there are no locks, no open folders, no mapped files; writing says so."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RECORDING = ROOT / "recordings" / "office"

READING: dict[str, list[str]] = {
    "replay": ["--json"], "history": ["--json"], "tail": ["--json"], "show": ["3", "--json"],
    "diff": ["12:00..19:30", "--json"], "timeline": ["main_door", "--json"],
    "probabilities": ["--json"], "best-time": ["main_door", "--json"], "evaluate": ["--json"],
    "info": ["--json"], "verify": ["--json"], "recover": ["--json"],
}  # fmt: skip
FILES = ("jsonl", "yaml", "csv", "pgm", "html", "parquet")
WRITING: dict[str, list[str]] = {
    "update": ["1", "--state", "open"], "observe": ["1", "open"], "record": [],
    "recover": ["--yes"], "compact": [],
}  # fmt: skip


@cache  # what Linux says is asked once for each of the others
def _run(system: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    if system == "linux":
        command = [sys.executable, "-m", "semmap_log"]
    else:
        command = [sys.executable, "-m", "tests.store.elsewhere", system]
    return subprocess.run(
        [*command, *map(str, arguments)],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        check=False,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "verb"),
    [*(("windows", verb) for verb in READING), ("macos", "replay"), ("macos", "verify")],
)
def test_every_reading_verb_says_the_same(system: str, verb: str) -> None:
    """As on Linux, byte for byte."""
    here, there = (_run(s, verb, RECORDING, *READING[verb]) for s in ("linux", system))

    assert (there.returncode, there.stderr) == (here.returncode, here.stderr)
    assert there.stdout == here.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "ending"), [*(("windows", ending) for ending in FILES), ("macos", "jsonl")]
)
def test_files_come_out_the_same(tmp_path: Path, system: str, ending: str) -> None:
    """An export is an answer: it needs no lock either."""
    made = {}
    for one in ("linux", system):
        out = tmp_path / one / f"office.{ending}"
        out.parent.mkdir()
        done = _run(one, "export", RECORDING, out, "--default-prob", "0.5") if (
            ending == "yaml"
        ) else _run(one, "export", RECORDING, out)  # fmt: skip
        assert done.returncode == 0, done.stderr
        made[one] = out.read_bytes()

    assert made[system] == made["linux"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "verb"), [*(("windows", verb) for verb in WRITING), ("macos", "update")]
)
def test_writing_says_what_is_missing(tmp_path: Path, system: str, verb: str) -> None:
    """Nothing is changed, and no lock file is left."""
    log = tmp_path / "office"
    log.mkdir()
    for one in RECORDING.iterdir():
        (log / one.name).write_bytes(one.read_bytes())

    done = _run(system, verb, log, *WRITING[verb])

    assert done.returncode == 1
    assert "a log cannot be written on this system, which lacks" in done.stderr
    assert ("fcntl" if system == "windows" else "os.fdatasync") in done.stderr
    assert "Reading works" in done.stderr
    assert sorted(p.name for p in log.iterdir()) == sorted(p.name for p in RECORDING.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("system", ["windows", "macos"])
def test_no_log_is_begun_there(tmp_path: Path, system: str) -> None:
    """Not even its folder."""
    done = _run(system, "init", tmp_path / "office", "--tz", "UTC")

    assert (done.returncode, "which lacks" in done.stderr) == (1, True)
    assert not (tmp_path / "office").exists()
