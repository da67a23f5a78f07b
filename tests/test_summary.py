"""What `info` says of a log's health: durability, clocks that lied, the head."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.events import RobotPose
from semmap_log.log.door_log.read_log import open_any
from tests.conftest import SteadyClock
from tests.verbs import ran


def lying_log(path: Path) -> Path:
    """Write a log at two levels of durability, whose clock is set back and then forgotten."""
    clock = SteadyClock()
    with sl.create(path, tz="Europe/Vienna", clock=clock) as log:
        for _ in range(3):
            log.add_door()
    with sl.append(path, clock=clock, durability="batch") as log:
        clock.now_ns -= 7200 * 10**9
        log.add_door()
        clock.now_ns = 3 * 10**9
        log.add_door()
    return path


def test_durability_is_counted(tmp_path: Path) -> None:
    """By commits, in the order from the strongest promise down."""
    summary = open_any(lying_log(tmp_path / "log")).summary()

    assert [("event", 3), ("batch", 2)] == list(summary.durability.items())
    assert 5 == summary.commits


def test_suspect_commits_have_event_time_and_reason(tmp_path: Path) -> None:
    """Those at which the clock moved, not those that follow it."""
    summary = open_any(lying_log(tmp_path / "log")).summary()

    back, unset = summary.suspects
    assert (3, 4) == (back.event, unset.event)
    assert "went back by 2 h" in back.why
    assert "before the year 2000" in unset.why
    assert 3 * 10**9 < unset.wall_clock_ns < 4 * 10**9
    assert [] == summary.warnings or all("happened after" in text for text in summary.warnings)


@pytest.mark.usefixtures("terminal")
def test_info_tells_people_and_machines(tmp_path: Path, capsys) -> None:
    """The head with what it is good for; suspects with their local time."""
    path = lying_log(tmp_path / "log")

    said = json.loads(ran(capsys, "info", path, "--json")[1])
    _, out, _ = ran(capsys, "info", path)

    assert {"event": 3, "batch": 2} == said["durability"]
    assert [3, 4] == [suspect["event"] for suspect in said["suspects"]]
    assert said["suspects"][1]["wall_clock"].startswith("1970-01-01T00:00:03.")
    assert "durability  event 3, batch 2" in out
    assert f"head        {said['head']}" in out
    assert "suspect clock: event 4, 1970-01-01 01:00:03" in out
    assert "--head HASH" in out


def test_many_suspects_do_not_scroll_the_rest_away(tmp_path: Path, capsys) -> None:
    """Twenty are shown; JSON has them all."""
    clock = SteadyClock()
    with sl.create(tmp_path / "log", tz="UTC", clock=clock, durability="none") as log:
        for _ in range(25):
            clock.now_ns -= 10**9
            log.add_door()

    _, out, _ = ran(capsys, "info", tmp_path / "log")

    assert 21 == out.count("suspect clock:")
    assert "4 commits more (all: --json)" in out


@pytest.mark.usefixtures("terminal")
def test_personal_data_are_told(tmp_path: Path, capsys) -> None:
    """Who and why, what is said of doors, where the robot was."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", clock=SteadyClock()) as log:
        log.add_door(name="Zoe's office", actor="anna", reason="first map")
        log.annotate(1, "owner", "Zoe", actor="bert")
        wrong = log.annotate(1, "owner", "Zoe M.", actor="anna", source="laser")
        log.retract(wrong.first_event)
        log.append([RobotPose(x=1.0, y=2.0, theta=0.0)] * 3)
        log.start_patrol()

    shown = [" ".join(line.split()) for line in ran(capsys, "info", path)[1].splitlines()]
    assert "notes 3, 1 of them with a reason; by anna 2, bert 1" in shown
    assert "annotated owner 2, name 1" in shown
    assert "tracks 3 poses, 1 round" in shown

    said = json.loads(ran(capsys, "info", path, "--json")[1])["personal_data"]
    assert said == {
        "notes": 3, "actors": {"anna": 2, "bert": 1}, "sources": {"laser": 1}, "reasons": 1,
        "annotations": {"name": 1, "owner": 2}, "poses": 3, "patrols": 1,
    }  # fmt: skip


def test_a_log_that_tells_of_nobody_says_nothing_of_it(tmp_path: Path) -> None:
    """Doors and sightings without a note are no personal data."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.observe(log.add_door(), "open")

    assert not open_any(tmp_path / "log").summary().personal
