"""A day of the doors: the building's own midnights, and the states that replays show."""

from __future__ import annotations

import random
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.analysis.day import SLOT_NS, day_of_doors
from semmap_log.core.model.doors import DoorState
from tests.conftest import SteadyClock
from tests.test_replay import random_log

OFFICE = Path(__file__).parents[1] / "recordings" / "office"


@pytest.mark.parametrize("seed", range(3))
def test_a_half_hour_all_open_is_open_in_replays(seed: int, tmp_path: Path) -> None:
    """At moments drawn from each half hour in which a door was all the time open, or closed."""
    dice = random.Random(seed)
    log = sl.read(OFFICE) if seed == 0 else _random(tmp_path / "log", dice)
    checked = 0

    day = day_of_doors(log)

    for slot, (start, end) in enumerate(pairwise(day.edges_ns.tolist())):
        moment = dice.randrange(start, end)
        if moment > log.end_ns():
            break
        doors = log.replay(at=f"@{moment}").doors
        for door in day.doors:
            if door.shares.known[slot] == 1 and door.shares.opened[slot] in {0, 1}:
                expected = DoorState.OPEN if door.shares.opened[slot] else DoorState.CLOSED
                assert expected == doors[door.door_id].state
                checked += 1
            assert (door.shares.there[slot] > 0) or door.door_id not in doors
    assert checked > 0 or seed


def _random(folder: Path, dice: random.Random) -> sl.DoorLog:
    random_log(folder, dice, commits=40)
    return sl.read(folder)


@pytest.mark.parametrize(
    ("date", "slots"), [("2026-03-28", 48), ("2026-03-29", 46), ("2026-10-25", 50)]
)
def test_a_day_is_as_long_as_its_clocks_say(
    date: str, slots: int, tmp_path: Path, clock: SteadyClock
) -> None:
    """From midnight to midnight: 23 hours when the clocks go forward, 25 when they go back."""
    with sl.create(tmp_path / "log", tz="Europe/Vienna", clock=clock) as log:
        door = log.add_door(state="open", at="2026-03-01T12:00+01:00")
        log.observe(door, "closed", at="2026-03-02T12:00+01:00")

        day = day_of_doors(log, f"{date}T12:00")

    assert date == day.date
    assert slots == len(day.edges_ns) - 1
    assert [SLOT_NS] * slots == np.diff(day.edges_ns).tolist()


@pytest.mark.parametrize("tz", ["UTC", "America/New_York", "Pacific/Auckland"])
def test_the_first_day_of_all_times_is_a_day(tz: str, tmp_path: Path) -> None:
    """A robot whose clock was never set: its midnights are nanoseconds, few or below 0."""
    with sl.create(tmp_path / "log", tz=tz, clock=SteadyClock(10**9)) as log:
        log.observe(log.add_door(state="closed"), "open")

        day = day_of_doors(log)

    (only,) = day.doors
    assert 48 == len(day.edges_ns) - 1
    assert 1 == only.changes


def test_before_and_after_what_is_known(tmp_path: Path, clock: SteadyClock) -> None:
    """Before its adding and after the log's end a door is not there."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        door = log.add_door(state="unknown", at="2026-02-27T06:00")
        log.observe(door, "open", at="2026-02-27T12:15")
        log.observe(door, "closed", at="2026-02-27T18:00")
        early, day = day_of_doors(log, "2026-02-26T12:00"), day_of_doors(log, "2026-02-27T12:00")

    (only,) = day.doors
    assert () == tuple(early.doors)
    assert [0] * 12 + [1] * 24 == only.shares.there.tolist()[:36]
    assert [0.5] + [1] * 5 + [0.5] + [0] * 5 == only.shares.known.tolist()[24:36]
    assert [1] * 7 == only.shares.opened.tolist()[24:31]
    assert np.isnan(only.shares.opened[31:36]).all()
    assert 2 == only.changes


def test_the_last_day_is_that_of_the_last_report(tmp_path: Path, clock: SteadyClock) -> None:
    """Not that of a place or a note which somebody added to an old log."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        door = log.add_door(state="closed", at="2026-02-20T06:00")
        log.observe(door, "open", at="2026-02-20T12:00")
        log.update_door(door, x=1, y=2, theta=0, width=1)
        log.annotate(door, "note", "new lock")

        day = day_of_doors(log)

    assert "2026-02-20" == day.date
    assert 1 == day.doors[0].changes


def test_a_day_begins_as_the_one_before_ended(tmp_path: Path, clock: SteadyClock) -> None:
    """A door that was opened yesterday is open from midnight on, until somebody closes it."""
    with sl.create(tmp_path / "log", tz="UTC", holds=0, clock=clock) as log:
        door = log.add_door(state="open", at="2026-02-26T06:00")
        log.observe(door, "closed", at="2026-02-27T12:00")
        log.observe(door, "open", at="2026-02-27T18:00")

        (only,) = day_of_doors(log, "2026-02-27T12:00").doors

    assert [1] * 24 + [0] * 12 == only.shares.opened.tolist()[:36]
    assert [1] * 36 == only.shares.known.tolist()[:36]
