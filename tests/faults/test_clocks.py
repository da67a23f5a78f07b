"""Clocks lie: recorded times only grow, and the order of events never depends on a clock."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from fault_injection.clocks import DAY, LIES, NOW, LyingClock, at_random, write_by

import semmap_log as sl


@pytest.mark.parametrize("lie", LIES)
def test_no_clock_changes_the_order(lie: str, memory: Path) -> None:
    """Over several segments and openings: no gap, no event in another place, none lost."""
    outcome = write_by(memory / "log", lie, LIES[lie])

    assert "" == outcome.problem
    assert (24, 0) == (outcome.checked, outcome.lost)


@pytest.mark.slow
def test_clocks_that_jump_at_random_change_nothing_either(memory: Path) -> None:
    """By nanoseconds, seconds, days and years, back and forth."""
    dice = random.Random(3)

    outcomes = [write_by(memory / str(n), str(n), at_random(dice)) for n in range(10)]

    assert [] == [outcome for outcome in outcomes if not outcome.is_good]


def test_what_has_no_time_of_its_own_folds_as_the_clock_said(memory: Path) -> None:
    """By a clock two days behind, a sighting without a time is older than one before."""
    clock = LyingClock(lambda look, ns: ns - (look > 8) * 2 * DAY)
    with sl.create(memory / "log", tz="UTC", clock=clock) as log:
        door = log.add_door()
        log.observe(door, "open")
        clock.looks = 8
        log.observe(door, "closed")

        entries = list(log.history())
        assert entries[1].happened_ns - entries[2].happened_ns > DAY
        assert entries[1].recorded_ns < entries[2].recorded_ns
        assert log.replay()[door].state is sl.DoorState.OPEN
        assert 0 == len(log.replay(at=entries[2].happened_ns))


def test_a_time_that_is_still_to_come_folds_as_recorded(memory: Path) -> None:
    """An event that says next year counts from when it was recorded, not later."""
    with sl.create(memory / "log", tz="UTC", clock=LyingClock(lambda _, ns: ns)) as log:
        door = log.add_door()
        recorded = log.observe(door, "open", at=NOW + 365 * DAY).commit.recorded_ns

        assert log.replay(at=recorded)[door].state is sl.DoorState.OPEN
        assert log.replay(at=recorded - 1)[door].state is sl.DoorState.UNKNOWN
        assert NOW + 365 * DAY == log.event(1).happened_ns


@pytest.mark.parametrize(
    ("lie", "said"),
    [
        ("tells the truth", []),
        ("goes back by a second", ["went back by"]),
        ("goes back by two days and returns", ["went back by 2 days", "jumped ahead by 2 days"]),
        ("jumps to 2038", ["jumped ahead by"]),
        ("falls back to 1970", ["before the year 2000"]),
        ("begins in 1970", ["before the year 2000", "jumped ahead by 56.2 years"]),
    ],
)
def test_suspect_commits_are_named(lie: str, said: list[str], memory: Path) -> None:
    """`info` says at which events the clock went back, or jumped against the clock of its boot."""
    write_by(memory / "log", lie, LIES[lie])

    suspects = [s.why for s in sl.read(memory / "log").summary().suspects]

    assert len(said) == len(suspects)
    assert all(text in suspect for text, suspect in zip(said, suspects, strict=True))
