"""Times to come: said at once, in whatever way they come into a log."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorObserved
from semmap_log.errors import FutureTimesWarning
from semmap_log.interop.importing.importing import import_file
from tests.conftest import SteadyClock

MINUTE_NS = 60 * 10**9
LATER = "2036-01-01T10:00Z"


@pytest.fixture
def log(tmp_path: Path, clock: SteadyClock) -> sl.DoorLogWriter:
    log = sl.create(tmp_path / "log", tz="UTC", clock=clock)
    log.add_door(name="front", at="2026-02-01")
    return log


def test_a_single_sighting_is_warned_of_at_once(log: sl.DoorLogWriter) -> None:
    """With its time; the next ones again when they are ten times as many, and at the end."""
    with pytest.warns(FutureTimesWarning, match="^1 event happens in the future, at 2036-01-01"):
        log.observe("front", "open", at=LATER)
    with warnings.catch_warnings():
        warnings.simplefilter("error", FutureTimesWarning)
        for _ in range(8):
            log.observe("front", "open", at=LATER)
    with pytest.warns(FutureTimesWarning, match="^10 events happen"):
        log.observe("front", "closed", at=LATER)
    log.close()


def test_a_minute_is_no_time_to_come(log: sl.DoorLogWriter, clock: SteadyClock) -> None:
    """Clocks of two machines differ; what is past, or says no time, is fine."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", FutureTimesWarning)
        log.observe("front", "open", at=clock.now_ns + MINUTE_NS)
        log.observe("front", "open", at="2026-02-03")
        log.observe("front", "open")
        log.close()


def test_many_at_once_are_counted(log: sl.DoorLogWriter, clock: SteadyClock) -> None:
    """Events and batches of them, in one commit."""
    times = [clock.now_ns + hours * 60 * MINUTE_NS for hours in (-1, 1, 2)]
    batch = EventBatch.of(
        DoorObserved, door_id=[1, 1, 1], state=[1, 2, 1], happened_ns=times,
    )  # fmt: skip
    one = DoorObserved(door_id=DoorId(1), state=DoorState.OPEN, happened_ns=times[2])

    with pytest.warns(FutureTimesWarning, match="^3 events happen"):
        log.append([batch, one])
    log.close()


def test_an_import_is_warned_of(log: sl.DoorLogWriter, tmp_path: Path) -> None:
    """A year that was typed wrong."""
    (tmp_path / "x.csv").write_text(f"timestamp,door,state\n{LATER},front,open\n")

    with pytest.warns(FutureTimesWarning, match="^1 event happens"):
        import_file(log, tmp_path / "x.csv")
    log.close()


def test_verbs_say_it_on_stderr(tmp_path: Path) -> None:
    """`observe --at` and `record`; what was asked for is done."""
    log = str(tmp_path / "log")
    with sl.create(log, tz="UTC") as writing:
        writing.add_door(name="front", at="2026-02-01")
    line = {"kind": "DoorObserved", "door_id": 1, "state": "OPEN", "happened": LATER}

    done = [
        subprocess.run(
            [sys.executable, "-m", "semmap_log", *words], input=json.dumps(line) + "\n",
            capture_output=True, text=True, check=True,
        )
        for words in (("observe", log, "front", "open", "--at", LATER), ("record", log))
    ]  # fmt: skip

    for one in done:
        assert "warning: 1 event happens in the future, at 2036-01-01 10:00" in one.stderr
    assert 2 == len(list(sl.read(log).history(kinds=[DoorObserved])))
