"""Patrol rounds out of a history."""

from __future__ import annotations

from pathlib import Path

import semmap_log as sl
from semmap_log.core.folds.history import ROUND_KINDS, Round, rounds
from semmap_log.core.model.commits import Note
from semmap_log.core.model.events import PatrolFinished, PatrolStarted
from semmap_log.core.model.moments import DAY_NS
from tests.conftest import SteadyClock

NOON_NS = 1_772_280_000 * 10**9
"""2026-02-28T12:00 UTC."""


def test_a_round_has_its_times_its_name_and_its_robot(tmp_path: Path, clock: SteadyClock) -> None:
    """One that goes on has no end; one that is only known by its end has no start."""
    times = [NOON_NS + minute * 60 * 10**9 for minute in range(4)]
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.append(
            [PatrolStarted(patrol=1, happened_ns=times[0])], note=Note(actor="tug1", reason="night")
        )
        log.append(
            [PatrolFinished(patrol=1, happened_ns=times[1])], note=Note(actor="dock", reason="home")
        )
        log.append([PatrolFinished(patrol=7, happened_ns=times[2])], note=Note(actor="tug2"))
        log.append([PatrolStarted(patrol=8, happened_ns=times[3])], note=Note(actor="tug1"))

        found = rounds(log.history())

    assert [
        Round(1, times[0], times[1], "tug1", "night"),
        Round(7, None, times[2], "tug2", ""),
        Round(8, times[3], None, "tug1", ""),
    ] == found
    assert ["night", "round 7", "round 8"] == [each.label for each in found]


def test_what_was_taken_back_began_no_round(tmp_path: Path, clock: SteadyClock) -> None:
    """Nor does the second start of a number, and a time from the future counts as recorded."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        wrong = log.append([PatrolStarted(patrol=3, happened_ns=NOON_NS)]).first_event
        log.retract(wrong)
        started = log.append([PatrolStarted(patrol=3, happened_ns=NOON_NS + DAY_NS * 9999)])
        log.append([PatrolStarted(patrol=3, happened_ns=NOON_NS + 5)])

        (found,) = rounds(log.history(kinds=ROUND_KINDS))

    assert started.commit.recorded_ns == found.start_ns
