"""The log's end, from which relative times count: known without a replay."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.model.events import DoorObserved, Retracted
from tests.calls import calls_of
from tests.conftest import SteadyClock

HOUR_NS = 3_600 * 10**9
START_NS = 1_772_323_200 * 10**9


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A log of some hours, in which the latest sighting was taken back."""
    clock = SteadyClock(START_NS)
    with sl.create(tmp_path / "log", tz="UTC", clock=clock, compact=False) as log:
        log.add_door(name="front", at=START_NS - 9 * HOUR_NS)
        for hours in (8, 6, 4, 2):
            log.observe("front", "open", at=START_NS - hours * HOUR_NS)
        log.retract(5, at=START_NS - 5 * HOUR_NS)
    return tmp_path / "log"


QUESTIONS: dict[str, Callable[[sl.DoorLog, Any], Any]] = {
    "replay": lambda log, time: log.replay(at=time),
    "replay, as known": lambda log, time: log.replay(known_at=time),
    "fold of a scope": lambda log, time: log.state_in(log.scope(at=time)).to_arrays()["state"],
    "timeline": lambda log, time: len(log.timeline(sl.DoorId(1), at=time)),
    "history": lambda log, time: [entry.number for entry in log.history(since=time)],
    "batches": lambda log, time: [list(batch) for batch in log.batches(until=time)],
    "instant": lambda log, time: log.instant(time),
}


@pytest.mark.parametrize("question", QUESTIONS)
@pytest.mark.parametrize("time", ["2h ago", "now", "yesterday 23:00"])
def test_a_relative_time_takes_no_more_replays(question: str, time: str, path: Path) -> None:
    """Than the moment that it stands for; and the answer is the same."""
    ask = QUESTIONS[question]
    log = sl.read(path)
    is_known_at = question == "replay, as known"  # of which the end is the last commit
    end = (log.known_moment if is_known_at else log.moment)(time).ns
    answers: list[Any] = []

    relative = calls_of(lambda: answers.append(repr(ask(sl.read(path), time))))
    absolute = calls_of(lambda: answers.append(repr(ask(sl.read(path), end))))

    assert relative["state_at"] == absolute["state_at"]
    assert relative["keyframe_at"] == absolute["keyframe_at"]
    assert answers[0] == answers[1]


def test_the_end_is_asked_once(path: Path) -> None:
    """Until the log is refreshed."""
    log = sl.read(path)
    log.end_ns()

    assert 0 == calls_of(log.end_ns)["latest_happened_ns"]
    log.refresh()
    assert 1 == calls_of(log.end_ns)["latest_happened_ns"]


def test_what_is_taken_back_is_no_end(path: Path) -> None:
    """The sighting of two hours before was; the one before it is the latest."""
    assert START_NS - 4 * HOUR_NS == sl.read(path).end_ns()


def test_only_the_last_segment_is_asked_where_that_is_enough(tmp_path: Path) -> None:
    """No event counts as later than it was recorded."""
    path, clock = tmp_path / "log", SteadyClock(START_NS)
    with sl.create(path, tz="UTC", clock=clock, compact=False) as writer:
        for _ in range(3):
            writer.add_door()
            writer._writer._chain.roll(writer._writer._end)
    log = sl.read(path)

    assert 3 == len(log._reader.segments)
    assert 1 == calls_of(log.end_ns)["_latest_in"]


times = st.one_of(st.none(), st.integers(0, 2 * START_NS))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(times, st.booleans(), st.booleans()), max_size=12), st.booleans())
def test_the_end_is_the_latest_of_what_counts(
    tmp_path_factory: pytest.TempPathFactory,
    steps: list[tuple[int | None, bool, bool]],
    is_closed: bool,
) -> None:
    """As a replay finds it, whatever was taken back, in one segment or several, closed or not."""
    path = tmp_path_factory.mktemp("end") / "log"
    log = sl.create(path, tz="UTC", clock=SteadyClock(START_NS), compact=False)
    log.add_door(at=5)
    for at_ns, takes_back, rolls in steps:
        log.append([DoorObserved(door_id=sl.DoorId(1), state=sl.DoorState.OPEN, happened_ns=at_ns)])
        last = log.last_event()
        if takes_back:
            hidden = Retracted(first_event=max(last - 2, 1), last_event=last, happened_ns=at_ns)
            log.append([hidden])
        if rolls:
            log._writer._chain.roll(log._writer._end)
    if is_closed:
        log.close()

    read = sl.read(path)

    assert read.state_in().latest_happened_ns == read.end_ns()
    log.close()
