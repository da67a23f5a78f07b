"""What a shell offers: it reads, and never speaks."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.events import LevelAdded


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Doors on two levels: two of one name, one whose name needs quotes, one without."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        log.append([LevelAdded(level=0, name="ground"), LevelAdded(level=1, name="first floor")])
        log.add_door(name="front", level=0)
        log.add_door(name="both", level=0)
        log.add_door(name="both", level=1)
        log.add_door(name="the back door", level=0)
        log.add_door(level=0)
    return path


def _offered(folder: Path, *words: str, shell: str = "bash") -> list[str]:
    """Return what is offered for the last of the words."""
    line = " ".join(["semmap-log", *words])
    done = subprocess.run(
        [sys.executable, "-m", "semmap_log"], cwd=folder, capture_output=True, text=True,
        timeout=200, check=False, env=os.environ | {
            "_SEMMAP_LOG_COMPLETE": f"complete_{shell}", "COMP_WORDS": line,
            "COMP_CWORD": str(len(words)), "_TYPER_COMPLETE_ARGS": line,
        },
    )  # fmt: skip
    assert (0, "") == (done.returncode, done.stderr)
    return done.stdout.split()


ALL = ["front", "ground/both", "3", "4", "5"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["pro"], ["probabilities", "prolog-module"]),
        (["observe", "log", ""], ALL),
        (["observe", "log", "f"], ["front"]),
        (["observe", "log", "front", "o"], ["open", "offline"]),
        (["observe", "log", "front", "O"], ["OPEN", "OFFLINE"]),
        (["history", "log", "g"], ["ground/both"]),
        (["probabilities", "log", "front", "g"], ["ground/both"]),
        (["tail", "log", "--door", ""], ALL),
        (["add", "log", "--level", ""], ["ground", "1"]),
        (["costmap", "log", "x.png", "--level", "g"], ["ground"]),
        (["history", "log", "--kind", "DoorU"], ["DoorUpdated"]),
        (["observe", "nolog", ""], []),
        (["observe", "file", ""], []),
        (["observe", "broken", ""], []),
        (["rec"], ["record", "recover"]),
    ],
    ids=str,
)
def test_what_is_offered(log: Path, words: list[str], offered: list[str]) -> None:
    """Names, ids where a name would have to be quoted."""
    (log.parent / "file").write_text("x")
    (log.parent / "broken").mkdir()
    whole = next(log.glob("*.mcap")).read_bytes()
    (log.parent / "broken" / "log_000000.mcap").write_bytes(whole[:100] + b"x" * 500)
    before = sorted((path, path.stat().st_mtime_ns) for path in log.parent.rglob("*"))

    assert offered == _offered(log.parent, *words)

    assert before == sorted((path, path.stat().st_mtime_ns) for path in log.parent.rglob("*"))


def test_shells_that_show_help_tell_what_an_id_means(log: Path) -> None:
    """A door by its number says its name."""
    said = " ".join(_offered(log.parent, "observe", "log", "", shell="zsh"))

    assert "the back door" in said
