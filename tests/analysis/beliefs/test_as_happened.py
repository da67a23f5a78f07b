"""Beliefs as if all had been told at once: held against a log in which it was."""

from __future__ import annotations

import shutil
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.analysis.beliefs import apply_probabilities, best_time, probabilities, typical_weeks
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorUpdated,
    Event,
)
from semmap_log.core.model.meaning import Changed
from semmap_log.errors import UnknownDoorError
from tests.conftest import SteadyClock

SECOND_NS, HOUR_NS = 10**9, 3600 * 10**9
FIRST_NS = 1_772_323_200 * 10**9
"""2026-03-01T00:00Z."""
IMPORTED_NS = FIRST_NS + 400 * 24 * HOUR_NS
DOORS = (DoorId(1), DoorId(2))
ESTIMATORS = ("filter", "schedule", "count", "last")


@st.composite
def told(draw: st.DrawFn) -> list[Event]:
    """Draw what happened to two doors over three weeks, in order of time."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.integers(1, 40))
    hours = np.unique(rng.integers(1, 21 * 24, count)).tolist()
    events: list[Event] = [
        DoorAdded(door_id=door, x=0, y=0, theta=0, width=1,
                  happened_ns=FIRST_NS + int(rng.integers(0, 10)) * HOUR_NS + door)
        for door in DOORS
    ]  # fmt: skip
    for hour in hours:
        at_ns = FIRST_NS + (10 + hour) * HOUR_NS + 7
        door, state = DOORS[int(rng.integers(2))], DoorState(int(rng.integers(0, 3)))
        kind = int(rng.integers(0, 12))
        if kind == 0:
            name = f"called {hour}"
            events.append(DoorAnnotated(door_id=door, key="name", value=name, happened_ns=at_ns))
        elif kind == 1:
            events.append(DoorPassed(door_id=door, passed=True, waited_s=1.0, happened_ns=at_ns))
        elif kind <= 3:
            events.append(DoorUpdated(door_id=door, changed=Changed.STATE, state=state,
                                      happened_ns=at_ns))  # fmt: skip
        else:
            events.append(DoorObserved(door_id=door, state=state, accuracy_open=0.9,
                                       accuracy_closed=0.8, happened_ns=at_ns))  # fmt: skip
    if draw(st.booleans()):
        events.append(DoorRemoved(door_id=DOORS[1], happened_ns=FIRST_NS + 18 * 24 * HOUR_NS + 9))
        gone_ns = events[-1].happened_ns
        events = [e for e in events if getattr(e, "door_id", 0) != DOORS[1]
                  or (e.happened_ns or 0) <= (gone_ns or 0)]  # fmt: skip
    return sorted(events, key=lambda event: event.happened_ns or 0)


def imported(path: Path, events: list[Event], retracted: set[int], order: list[int]) -> sl.DoorLog:
    """Return a log that was told everything long after, the doors first, and took some back."""
    shuffled = sorted(
        range(len(events)),
        key=lambda i: (not isinstance(events[i], DoorAdded), order[i % len(order)], i),
    )
    with sl.create(path, tz="UTC", clock=SteadyClock(IMPORTED_NS)) as log:
        for place in shuffled:
            number = log.append([events[place]]).first_event
            if place in retracted:
                log.retract(number)
    return sl.read(path)


def told_at_once(path: Path, events: list[Event]) -> sl.DoorLog:
    """Return a log in which each event was recorded when it happened."""
    clock = SteadyClock(FIRST_NS)
    with sl.create(path, tz="UTC", clock=clock) as log:
        for event in events:
            clock.now_ns = event.happened_ns or 0
            log.append([event])
    return sl.read(path)


@settings(max_examples=12, deadline=None)
@given(
    events=told(),
    order=st.lists(st.integers(0, 99), min_size=1, max_size=9),
    taken_back=st.integers(0, 2**32 - 1),
    hour=st.integers(0, 22 * 24),
    how=st.tuples(st.sampled_from(ESTIMATORS), st.sampled_from([0, 2, 100])),
)
def test_beliefs_are_those_of_a_log_that_was_told_at_once(
    events: list[Event], order: list[int], taken_back: int, hour: int, how: tuple[str, int]
) -> None:
    """Bit for bit, with names and doors of that time; what is retracted today was never there."""
    rng = np.random.default_rng(taken_back)
    retracted = {
        place
        for place, event in enumerate(events)
        if isinstance(event, (DoorObserved, DoorPassed)) and rng.random() < 0.2
    }
    kept = [event for i, event in enumerate(events) if i not in retracted]
    moment = f"@{FIRST_NS + hour * HOUR_NS + SECOND_NS}"  # the clock ticks while it is told
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        late = imported(Path(folder, "late"), events, retracted, order)
        soon = told_at_once(Path(folder, "soon"), kept)
        asked = {"estimator": how[0], "horizon_ns": how[1] * HOUR_NS}

        found = [
            probabilities(late, at=moment, as_happened=True, **asked),
            probabilities(late, known_at=moment, as_happened=True, **asked),
            probabilities(late, at=moment, known_at="@" + moment[1:], as_happened=True, **asked),
        ]
        expected = probabilities(soon, known_at=moment, **asked)

    for beliefs in found:
        assert numbers(expected) == numbers(beliefs)


def numbers(beliefs: list[object]) -> list[tuple[object, ...]]:
    """Return all that a belief says, but for the numbers of events."""
    return [
        (b.door.door_id, b.door.name, b.door.state, b.known_ns, b.time_ns, b.p_open, b.low, b.high,
         b.is_known, b.evidence.counts, b.evidence.known_ns, b.evidence.coverage.days)
        for b in beliefs
    ]  # fmt: skip


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    """A log that was told of two weeks of a door a year later."""
    path = tmp_path_factory.mktemp("late") / "log"
    clock = SteadyClock(IMPORTED_NS)
    with sl.create(path, tz="UTC", clock=clock) as log:
        log.append([DoorAdded(door_id=DOORS[0], x=0, y=0, theta=0, width=1, happened_ns=FIRST_NS),
                    DoorAnnotated(door_id=DOORS[0], key="name", value="front",
                                  happened_ns=FIRST_NS)])  # fmt: skip
        log.append([
            DoorObserved(door_id=DOORS[0], accuracy_open=0.9, accuracy_closed=0.9,
                         state=DoorState.OPEN if 8 <= half // 2 % 24 < 18 else DoorState.CLOSED,
                         happened_ns=FIRST_NS + half * HOUR_NS // 2)
            for half in range(1, 14 * 48)
        ])  # fmt: skip
    return sl.read(path)


def test_all_that_asks_for_beliefs_takes_the_word(late: sl.DoorLog) -> None:
    """Without it nothing is known of that time; with it, what the sightings of before tell."""
    then = "2026-03-10T12:00"

    assert [] == probabilities(late, known_at=then)
    assert 0.9 < probabilities(late, known_at=then, as_happened=True)[0].p_open
    assert typical_weeks(late, known_at=then, as_happened=True)[0].is_known
    assert best_time(late, "front", known_at=then, as_happened=True).is_known
    with pytest.raises(UnknownDoorError, match=r"--as-happened"):
        best_time(late, "front", known_at=then)


def test_the_earlier_of_two_moments_bounds_what_is_known(late: sl.DoorLog) -> None:
    """The moment asked from is `at`, however early that is as of which it is asked."""
    at, known_at = "2026-03-10T23:00", "2026-03-10T12:00"

    (found,) = probabilities(late, at=at, known_at=known_at, as_happened=True)

    assert found.evidence.counts == probabilities(late, at=known_at)[0].evidence.counts
    assert late.instant(at) == found.known_ns


def test_numbers_as_happened_are_applied(late: sl.DoorLog, tmp_path: Path) -> None:
    """The map has from that moment on what would have been believed then."""
    shutil.copytree(late.path, tmp_path / "log")
    with sl.append(tmp_path / "log") as log:
        done = apply_probabilities(log, known_at="2026-03-10T12:00", as_happened=True)

    assert 1 == len(done.written)
    (belief,) = probabilities(late, at="2026-03-10T12:00")
    door = sl.read(tmp_path / "log").replay(at="2026-03-10T12:00").doors[DOORS[0]]
    assert round(belief.p_open, 6) == door.prob_open
