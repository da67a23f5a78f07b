"""Events as columns into a log: the same bytes, the same refusals as the same events one by one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    DoorUpdated,
    Event,
    PatrolStarted,
    Retracted,
    RobotPose,
)
from semmap_log.errors import (
    CommandReusedError,
    DoorExistsError,
    DoorRemovedError,
    InvalidEventError,
    SemmapError,
    UnknownDoorError,
)
from semmap_log.log.door_log.current_map import Events
from tests.conftest import SteadyClock

DOORS = 5
doors = st.integers(1, DOORS).map(DoorId)
strangers = st.integers(1, DOORS + 3).map(DoorId)
times = st.none() | st.integers(0, 2 * 10**18)
states = st.sampled_from(DoorState)
shares = st.floats(0, 1)


def kinds_about(door: st.SearchStrategy[DoorId]) -> st.SearchStrategy[Event]:
    """Return events about doors of that number, and a few about none."""
    return st.one_of(
        st.builds(DoorObserved, happened_ns=times, door_id=door, state=states, opening=shares,
                  accuracy_open=st.floats(0.5, 1)),
        st.builds(DoorRequested, happened_ns=times, door_id=door, state=states),
        st.builds(DoorPassed, happened_ns=times, door_id=door, passed=st.booleans()),
        st.builds(DoorUpdated, happened_ns=times, door_id=door, state=states,
                  changed=st.sampled_from([Changed.STATE, Changed.STATE | Changed.PROB_OPEN,
                                           Changed.POSE | Changed.WIDTH]),
                  x=shares, y=shares, theta=shares, width=shares, prob_open=shares),
        st.builds(DoorAdded, happened_ns=times, door_id=door),
        st.builds(DoorRemoved, happened_ns=times, door_id=door),
        st.builds(DoorAnnotated, happened_ns=times, door_id=door, key=st.just("name"),
                  value=st.sampled_from(["a", "b"])),
        st.builds(RobotPose, happened_ns=times, x=shares, y=shares, theta=shares),
        st.builds(PatrolStarted, happened_ns=times, patrol=st.integers(0, 9)),
        st.builds(Retracted, happened_ns=times, first_event=st.just(2),
                  last_event=st.integers(2, 9)),
    )  # fmt: skip


def written(
    folder: Path, commits: Iterable[Events], note: sl.Note = sl.Note()
) -> list[str | bytes]:
    """Return what became of commits, one after the other, and then the log's bytes.

    Ids and salts are zeros: an event that is refused may have drawn some, or not.
    """
    said: list[str | bytes] = []
    with sl.create(folder, tz="UTC", clock=SteadyClock(), entropy=bytes, compact=False) as log:
        log.append([DoorAdded(door_id=DoorId(i)) for i in range(1, DOORS + 1)])
        said.extend(_refusal(log, events, note) for events in commits)
        said.append(repr(log.door_index))
    return said + [path.read_bytes() for path in sorted(folder.glob("*.mcap"))]


def _refusal(log: sl.DoorLogWriter, events: Events, note: sl.Note) -> str:
    try:
        log.append(events, note=note)
    except SemmapError as error:
        return f"{type(error).__name__} {error}".replace(str(log.path), "LOG")
    return ""


def cut(events: list[Event], at: list[int]) -> list[Event | EventBatch]:
    """Return events as batches of so many; 0: one as it is."""
    found: list[Event | EventBatch] = []
    left = list(events)
    for size in at:
        if left:
            found.append(EventBatch.from_events(left[:size]) if size else left[0])
            left = left[max(size, 1) :]
    return [*found, *([EventBatch.from_events(left)] if left else [])]


notes = st.sampled_from([sl.Note(), sl.Note(actor="me")])


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.lists(kinds_about(strangers), min_size=1, max_size=30), min_size=1, max_size=3),
    st.lists(st.integers(0, 9), max_size=6),
    notes,
    st.booleans(),
)
def test_bytes_and_errors_are_those_of_single_events(
    tmp_path_factory: pytest.TempPathFactory, commits, sizes, note, lazily
) -> None:
    """
    Doors that come and go in a batch, cold kinds between hot ones, retractions, unknown doors.
    """
    single: list[Events] = [list(events) for events in commits]
    mixed: list[Events] = [cut(events, sizes) for events in commits]
    if lazily:
        single, mixed = ([iter(list(events)) for events in all_] for all_ in (single, mixed))
    one_by_one = written(tmp_path_factory.mktemp("bytes") / "log", single, note)

    assert one_by_one == written(tmp_path_factory.mktemp("bytes") / "log", mixed, note)


def test_a_batch_that_takes_an_adding_back_is_asked_about_that_door(tmp_path: Path) -> None:
    """The third event added door 3: behind its retraction nothing can be said of it."""
    events: list[Event] = [
        Retracted(first_event=2, last_event=2),
        DoorObserved(door_id=DoorId(3), state=DoorState.OPEN),
    ]

    said = written(tmp_path / "log", [[EventBatch.from_events(events)]])

    assert said[0] == "UnknownDoorError door 3 is not in the map."


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.lists(kinds_about(doors), min_size=1, max_size=60), st.sampled_from([200, 500, 2000]))
def test_chunks_are_cut_at_the_same_places(
    tmp_path_factory: pytest.TempPathFactory, events, chunk_bytes
) -> None:
    """A commit of many chunks, here small ones."""
    allowed = [e for e in events if not isinstance(e, (DoorAdded, DoorRemoved, Retracted))]
    from semmap_log.store import commit_records as commits

    folder = tmp_path_factory.mktemp("chunks")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(commits, "CHUNK_BYTES", chunk_bytes)
        patch.setattr(commits, "ROWS_AT_A_TIME", 7)
        one_by_one = written(folder / "one", [allowed])
        (folder / "one").rename(folder / "was")

        assert one_by_one == written(folder / "one", [EventBatch.from_events(allowed)])


@pytest.mark.slow
def test_large_commits_have_the_same_bytes(tmp_path: Path) -> None:
    """30,000 events of two kinds: some chunks of a MiB, compressed."""
    events: list[Event] = []
    for i in range(30_000):
        door = DoorId(1 + i % DOORS)
        events.append(DoorObserved(door_id=door, state=DoorState.OPEN, happened_ns=i * 10**9))
        if i % 7 == 0:
            events.append(DoorPassed(door_id=door, passed=i % 2 == 0))

    one_by_one = written(tmp_path / "log", [events])
    (tmp_path / "log").rename(tmp_path / "was")

    assert one_by_one == written(tmp_path / "log", [EventBatch.from_events(events)])


@pytest.fixture
def log(tmp_path: Path):
    with sl.create(tmp_path / "log", tz="UTC") as opened:
        opened.append([DoorAdded(door_id=DoorId(i)) for i in range(1, DOORS + 1)])
        yield opened


@pytest.mark.parametrize("few", [3, 1000])
def test_an_unknown_door_is_named_and_nothing_is_written(log: sl.DoorLogWriter, few: int) -> None:
    """As for a single event; the log can be written on."""
    ids = np.full(few, 1)
    ids[-1] = 77
    before = log.state.event

    with pytest.raises(UnknownDoorError, match=r"door 77 is not in the map\."):
        log.append(EventBatch.of(DoorObserved, door_id=ids, state=DoorState.OPEN))

    assert (
        before + 3
        == log.append(EventBatch.of(DoorPassed, door_id=[1, 2, 3], passed=True)).commit.last_event
    )


def test_what_changes_the_index_counts_for_the_rows_behind_it(log: sl.DoorLogWriter) -> None:
    """A door that a batch adds is there for its later rows, one that it removes is not."""
    seen = DoorObserved(door_id=DoorId(9), state=DoorState.OPEN, happened_ns=2 * 10**18)
    comes, goes = (
        DoorAdded(door_id=DoorId(9)),
        DoorRemoved(door_id=DoorId(9), happened_ns=19 * 10**17),
    )

    log.append(EventBatch.from_events([comes, seen]))
    with pytest.raises(DoorRemovedError, match="door 9 was removed; only what happened before"):
        log.append(EventBatch.from_events([seen, goes, seen]))
    with pytest.raises(DoorExistsError, match="door 9 is in the map already"):
        log.append(EventBatch.of(DoorAdded, door_id=[9]))


def test_values_are_checked_whoever_made_the_batch(log: sl.DoorLogWriter) -> None:
    """One that `of` made cannot be written to; one that was put together by hand is looked at."""
    made = EventBatch.of(DoorObserved, door_id=[1, 2], state=1)
    rows = made[DoorObserved].copy()
    rows["state"][1] = 9
    batch = replace(made, columns={DoorObserved.kind: rows})

    with pytest.raises(ValueError, match="read-only"):
        made[DoorObserved]["state"][1] = 9
    with pytest.raises(InvalidEventError, match=r"row 1: DoorObserved.state: .* got 9"):
        log.append(batch)


def test_a_command_of_columns_is_known_again(log: sl.DoorLogWriter) -> None:
    """The same columns, or the same events; others are refused."""
    batch = EventBatch.of(DoorObserved, door_id=[1, 2], state=1)
    first = log.append(batch, command_id=bytes(range(16)))

    assert log.append(batch, command_id=bytes(range(16))).repeated
    again = log.append([row.event for row in batch], command_id=bytes(range(16)))
    assert first.commit == again.commit
    with pytest.raises(CommandReusedError):
        log.append(
            EventBatch.of(DoorObserved, door_id=[1, 3], state=1), command_id=bytes(range(16))
        )


@pytest.mark.usefixtures("patient_poses")
def test_poses_that_wait_go_before_a_batch(log: sl.DoorLogWriter) -> None:
    """As before single events."""
    log.robot_pose(RobotPose(x=1.0, y=2.0, theta=0.0))

    appended = log.append(EventBatch.of(DoorObserved, door_id=[1, 2], state=1))

    assert (1, 2) == (appended.poses, appended.count)
    assert isinstance(log.event(appended.first_event - 1).event, RobotPose)


def test_what_a_log_gives_can_be_appended_to_another(log: sl.DoorLogWriter, tmp_path: Path) -> None:
    """Its numbers and recorded times stay behind."""
    log.append(EventBatch.of(DoorObserved, door_id=[1, 2], state=1, happened_ns=[10, 20]))
    log.annotate(DoorId(1), "name", "front")

    with sl.create(tmp_path / "copy", tz="UTC") as copy:
        copy.append(log.batches())
        copied = [repr(row.event) for batch in copy.batches() for row in batch]

    assert copied == [repr(row.event) for batch in log.batches() for row in batch]


def test_truth_values_stay_what_they_are(log: sl.DoorLogWriter) -> None:
    door_id = log.add_door()

    log.append(EventBatch.of(DoorPassed, door_id=[door_id] * 3, passed=[True, False, True]))

    passed = [each.event.passed for each in log.history(kinds=[DoorPassed])]
    assert [True, False, True] == passed


def test_no_rows_are_no_commit(log: sl.DoorLogWriter) -> None:
    """As no events are none."""
    with pytest.raises(SemmapError, match="at least one event"):
        log.append(EventBatch.of(DoorObserved, door_id=[], state=[]))
