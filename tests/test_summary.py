"""What `info` says of a log's health: durability, clocks that lied, the head."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.door_log.summary import open_any, summarize
from tests.cli.test_verify import semmap
from tests.conftest import SteadyClock


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
    """
    By commits, in the order from the strongest promise down.
    """
    summary = summarize(open_any(lying_log(tmp_path / "log")))

    assert [("event", 3), ("batch", 2)] == list(summary.durability.items())
    assert 5 == summary.commits


def test_suspect_commits_have_event_time_and_reason(tmp_path: Path) -> None:
    """
    Those at which the clock moved, not those that follow it.
    """
    summary = summarize(open_any(lying_log(tmp_path / "log")))

    back, unset = summary.suspects
    assert (3, 4) == (back.event, unset.event)
    assert "went back by 2 h" in back.why
    assert "before the year 2000" in unset.why
    assert 3 * 10**9 < unset.wall_clock_ns < 4 * 10**9
    assert [] == summary.warnings or all("happened after" in text for text in summary.warnings)


@pytest.mark.usefixtures("terminal")
def test_info_tells_people_and_machines(tmp_path: Path, capsys) -> None:
    """
    The head with what it is good for; suspects with their local time.
    """
    path = lying_log(tmp_path / "log")

    said = json.loads(semmap(capsys, "info", path, "--json")[1])
    _, out, _ = semmap(capsys, "info", path)

    assert {"event": 3, "batch": 2} == said["durability"]
    assert [3, 4] == [suspect["event"] for suspect in said["suspects"]]
    assert said["suspects"][1]["wall_clock"].startswith("1970-01-01T00:00:03.")
    assert "durability  event 3, batch 2" in out
    assert f"head        {said['head']}" in out
    assert "suspect clock: event 4, 1970-01-01 01:00:03" in out
    assert "--head HASH" in out


def test_many_suspects_do_not_scroll_the_rest_away(tmp_path: Path, capsys) -> None:
    """
    Twenty are shown; JSON has them all.
    """
    clock = SteadyClock()
    with sl.create(tmp_path / "log", tz="UTC", clock=clock, durability="none") as log:
        for _ in range(25):
            clock.now_ns -= 10**9
            log.add_door()

    _, out, _ = semmap(capsys, "info", tmp_path / "log")

    assert 21 == out.count("suspect clock:")
    assert "4 commits more (all: --json)" in out
