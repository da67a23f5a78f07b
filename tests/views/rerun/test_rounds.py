"""Patrol rounds as lanes."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'semmap-log[viewer]'")

import semmap_log as sl
from semmap_log.core.model.events import Event, PatrolFinished, PatrolStarted, Retracted
from semmap_log.views.rerun.recording import save_rrd
from tests.conftest import SteadyClock
from tests.views.rerun.some_logs import SECOND, START, Drawn

pytestmark = pytest.mark.viewer

STATE = "StateChange:state"


def drawn_of(tmp_path: Path, *commits: tuple[Event, str, str], since: int | None = None) -> Drawn:
    """Record an event a minute, each with actor and reason."""
    clock = SteadyClock(START)
    with sl.create(tmp_path / "log", tz="UTC", clock=clock, robot="rover") as log:
        for minute, (event, actor, reason) in enumerate(commits):
            clock.now_ns = START + minute * 60 * SECOND
            log.append([event], note=sl.Note(actor=actor, reason=reason))
    save_rrd(sl.read(tmp_path / "log"), tmp_path / "x.rrd", since=since)
    return Drawn(tmp_path / "x.rrd")


def said(drawn: Drawn, lane: str, timeline: str = "event") -> list[tuple[int, str]]:
    return [(at, value[0]) for at, value in drawn.rows(f"/rounds/{lane}", STATE, timeline)]


def test_each_robot_has_a_lane_that_says_what_it_drives_for(tmp_path: Path) -> None:
    """From start to end; between rounds is a gap, and a round without a name is its number."""
    drawn = drawn_of(
        tmp_path,
        (PatrolStarted(patrol=1), "tug1", "night round"),
        (PatrolStarted(patrol=2), "tug2", ""),
        (PatrolFinished(patrol=1), "tug1", ""),
        (PatrolFinished(patrol=2), "tug2", ""),
    )

    assert [(0, "night round"), (2, "")] == said(drawn, "tug1")
    assert [(1, "round 2"), (3, "")] == said(drawn, "tug2")
    assert ["night round"] == drawn.statics["/rounds/tug1", "StateConfiguration:labels"]
    assert ["night round", ""] == [label for _, label in said(drawn, "tug1", "happened")]


def test_a_round_in_a_round_stands_before_it(tmp_path: Path) -> None:
    """Once the later one has ended, the earlier one goes on."""
    drawn = drawn_of(
        tmp_path,
        (PatrolStarted(patrol=1), "", "long"),
        (PatrolStarted(patrol=2), "", "short"),
        (PatrolFinished(patrol=2), "", ""),
        (PatrolFinished(patrol=1), "", ""),
    )

    for timeline in ("happened", "recorded", "event"):
        labels = [label for _, label in said(drawn, "rover", timeline)]
        assert ["long", "short", "long", ""] == labels


def test_an_end_that_is_taken_back_lets_the_round_go_on(tmp_path: Path) -> None:
    """Along `event` it ended and goes on; along `happened` it never ended."""
    drawn = drawn_of(
        tmp_path,
        (PatrolStarted(patrol=1), "", "night"),
        (PatrolFinished(patrol=1), "", ""),
        (Retracted(first_event=1, last_event=1), "anna", ""),
    )

    assert [(0, "night"), (1, ""), (2, "night")] == said(drawn, "rover")
    assert ["night"] == [label for _, label in said(drawn, "rover", "happened")]


def test_a_late_start_is_known_when_it_was_recorded(tmp_path: Path) -> None:
    """Along `happened` the round begins where it began."""
    began_ns = START - 600 * SECOND
    drawn = drawn_of(
        tmp_path,
        (PatrolStarted(patrol=1, happened_ns=began_ns), "", "night"),
        (PatrolFinished(patrol=1), "", ""),
    )

    assert began_ns == said(drawn, "rover", "happened")[0][0]
    assert START <= said(drawn, "rover", "recorded")[0][0]


def test_a_part_begins_within_the_round(tmp_path: Path) -> None:
    """What was driven then stands there from the first moment on."""
    since_ns = START + 150 * SECOND

    drawn = drawn_of(
        tmp_path,
        (PatrolStarted(patrol=1), "", "early"),
        (PatrolFinished(patrol=1), "", ""),
        (PatrolStarted(patrol=2), "", "late"),
        (PatrolFinished(patrol=2), "", ""),
        since=since_ns,
    )

    for timeline in ("happened", "recorded"):
        (first, label), (_, end) = said(drawn, "rover", timeline)
        assert (since_ns, "late", "") == (first, label, end)
