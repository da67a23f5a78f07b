"""`cp -r` of a log at any moment, while it is written, closed, compacted and merged.

Each copy is read by the program that ends the page of the log format, which shares no code with the
product: it must hold the first events of the log, all that were acknowledged before `cp` began.
"""

from __future__ import annotations

import itertools
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.verification.findings import Severity
from tests.page_reader import READ
from tests.store.beside import recording

COPIES_A_LOG = 25
MAY_GO = re.compile(r"(\.tmp|/closed-\d+-\d+\.json|/metadata\.yaml)'")
"""Files of a log that come and go; without them the copy is a log."""
SKIPPED = re.compile(r"skipping file '[^']*\.mcap'")
"""Exchanged in the very moment when `cp` opened it: it says that it left this file out."""
MOST_SKIPPED = 3
ARGUMENTS = {"why": "1", "timeline": "1", "show": "0", "diff": ("event:0", "event:1")}
VERBS = ("replay", "history", "info", "tail", "timeline", "probabilities", "diff", "why", "show")


def cp(log: Path, copy: Path) -> bool:
    """Copy as a person does, and tell whether `cp` has copied all segments, as far as it says."""
    done = subprocess.run(
        ["cp", "-r", str(log), str(copy)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "LC_ALL": "C"},
    )
    said = [line for line in done.stderr.splitlines() if not MAY_GO.search(line)]
    assert [] == [line for line in said if not SKIPPED.search(line)]
    assert done.returncode == 0 or done.stderr
    return not said


def check(copy: Path, acknowledged: int) -> list[Any]:
    """Check that a copy opens, and return its events, read by the page's program."""
    events = READ(copy).events
    assert len(events) > acknowledged
    found = verify(copy)
    assert [] == found.of(Severity.DAMAGE, Severity.NOT_A_LOG)
    assert len(events) == found.events
    assert len(events) == sum(len(batch) for batch in sl.read(copy).batches())
    assert [1] == list(sl.read(copy).replay().doors)
    return list(events)


@pytest.mark.skipif(shutil.which("cp") is None, reason="there is no cp")
@pytest.mark.parametrize(
    "copies", [12, pytest.param(120, marks=pytest.mark.slow)], ids=["some", "many"]
)
def test_a_copy_taken_at_any_moment_is_a_log(tmp_path: Path, copies: int) -> None:
    """The first events of the log, whole; what was acknowledged before is among them."""
    left, skipped = copies, 0
    for seed in itertools.count(copies):
        if not left:
            break
        log, taken = tmp_path / str(seed) / "log", []
        with recording(log, seed) as recorder:
            for number in range(min(left, COPIES_A_LOG)):
                acknowledged, copy = recorder.acknowledged, log.with_name(f"copy{number}")
                if cp(log, copy):
                    taken.append(check(copy, acknowledged))
                else:
                    skipped += 1
                shutil.rmtree(copy)
            recorder.end()
        whole = READ(log).events
        assert all(events == whole[: len(events)] for events in taken)
        assert len(whole) > max(map(len, taken)) - 1
        left -= len(taken)
        shutil.rmtree(log.parent)
    assert skipped <= MOST_SKIPPED


@pytest.mark.skipif(shutil.which("cp") is None, reason="there is no cp")
def test_every_verb_answers_from_such_a_copy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And the next writer goes on with it, alone, or brings it up to date."""
    log = tmp_path / "log"
    with recording(log, 7) as recorder:
        assert cp(log, tmp_path / "copy")
        for verb in VERBS:
            arguments = ARGUMENTS.get(verb, ())
            with pytest.raises(SystemExit) as ended:
                main([verb, str(tmp_path / "copy"), *arguments])
            assert 0 == (ended.value.code or 0), (verb, capsys.readouterr())
        recorder.end()
    with sl.append(tmp_path / "copy") as opened:
        opened.observe(1, "open")
    assert 0 == verify(tmp_path / "copy").exit_code
