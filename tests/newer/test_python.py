"""What a program of its own is told about logs of a later version, by every way to read one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.events import DoorObserved, RobotPose, UnknownEvent
from semmap_log.errors import InvalidEventError, NewerLogError, NewerLogWarning
from semmap_log.store.byte_layout import FORMAT_MINOR
from semmap_log.store.reading.newer_events import NewerEvents
from tests.newer.logs import UNKNOWN, NewerLogs

pytestmark = pytest.mark.filterwarnings("ignore::semmap_log.errors.NewerLogWarning")


class Count:
    """A projection: how many events there are."""

    def initial(self) -> int:
        return 0

    def apply(self, state: int, batch: sl.EventBatch) -> int:
        return state + len(batch)


READERS: dict[str, Callable[[sl.DoorLog], Any]] = {
    "replay": lambda log: log.replay(),
    "replay at": lambda log: log.replay(at=1),
    "fold": lambda log: log.fold(Count()),
    "fold with a checkpoint": lambda log: log.fold(Count(), checkpoint=log.path.parent / "count"),
    "fold_part": lambda log: log.fold_part(Count(), 0, 2),
    "fold_live": lambda log: list(log.fold_live(Count(), stop=lambda: True)),
    "batches": lambda log: list(log.batches()),
    "batches of one kind": lambda log: list(log.batches(kinds=[RobotPose])),
    "retracted batches": lambda log: list(log.batches(retracted=True)),
    "follow": lambda log: list(log.follow(-1, stop=lambda: True)),
    "diff": lambda log: log.diff(0, 1),
    "timelines": lambda log: log.timelines(),
    "floor_map": lambda log: log.floor_map(),
    "resolve": lambda log: log.resolve("front"),
}


@pytest.mark.parametrize("how", ["closed", "live"])
@pytest.mark.parametrize("reader", READERS)
def test_what_may_be_touched_is_refused(
    newer: NewerLogs, tmp_path: Path, reader: str, how: str
) -> None:
    """An unknown event may set a door's state, or take back any other event."""
    log = sl.read(newer.log("locked", tmp_path, how=how))

    newer_version = rf"format 3\.{FORMAT_MINOR + 1}.*event 3 is of kind DoorLocked"
    with pytest.raises(NewerLogError, match=newer_version):
        READERS[reader](log)


@pytest.mark.parametrize("reader", READERS)
def test_what_is_marked_touches_nothing(newer: NewerLogs, tmp_path: Path, reader: str) -> None:
    """Every way to read goes on."""
    READERS[reader](sl.read(newer.log("weighed", tmp_path)))


def test_marked_events_are_in_no_answer(newer: NewerLogs, tmp_path: Path) -> None:
    """But they take their numbers, and a commit of nothing else is a commit."""
    log = sl.read(newer.log("weighed", tmp_path))

    with pytest.warns(NewerLogWarning, match="1 DoorWeighed"):
        numbers = [n for batch in log.batches() for n in batch.number.tolist()]

    followed = [(c.commit.last_event, len(c.batch)) for c in log.follow(-1, stop=lambda: True)]
    assert numbers == [0, 1, 2, 4]
    assert followed == [(1, 2), (2, 1), (3, 0), (4, 1)]
    assert log.fold(Count()) == 4
    assert log.replay().event == 4


def test_what_was_known_before_is_answered(newer: NewerLogs, tmp_path: Path) -> None:
    """As the later version answers it: nothing that came then can have changed it."""
    log = sl.read(newer.log("locked", tmp_path))
    before_ns = log.event(UNKNOWN).recorded_ns - 1

    assert log.replay(event=2).doors[sl.DoorId(1)].state.name == "OPEN"
    assert log.replay(known_at=before_ns).event == 2
    assert log.timelines(known_at=before_ns)[sl.DoorId(1)].state.tolist() == [2, 1]
    assert [len(c.batch) for c in log.follow(3, stop=lambda: True)] == [1]
    with pytest.raises(NewerLogError):
        log.replay(event=UNKNOWN)


def test_follow_gives_all_that_came_before(newer: NewerLogs, tmp_path: Path) -> None:
    """Then it stops, rather than pass over a commit."""
    commits = sl.read(newer.log("locked", tmp_path)).follow(-1, stop=lambda: True)

    assert [next(commits).commit.last_event, next(commits).commit.last_event] == [1, 2]
    with pytest.raises(NewerLogError):
        next(commits)


def test_lists_have_the_event(newer: NewerLogs, tmp_path: Path) -> None:
    """As an object of a class of its own name, with its bytes."""
    log = sl.read(newer.log("locked", tmp_path))

    entries = list(log.history())

    unknown = entries[UNKNOWN].event
    assert [entry.number for entry in entries] == [0, 1, 2, 3, 4]
    assert isinstance(unknown, UnknownEvent)
    assert (entries[UNKNOWN].kind, entries[UNKNOWN].door_id) == ("DoorLocked", None)
    assert unknown.data[4:8] == b"\1\0\0\0"
    assert log.entry(UNKNOWN).event == unknown
    assert log.event(UNKNOWN).event == unknown
    commits = list(log.follow(-1, stop=lambda: True, with_newer=True))
    assert [event.event for commit in commits for event in commit][UNKNOWN] == unknown
    assert [e.number for e in log.history(kinds=[DoorObserved])] == [2, 4]
    assert log.door_names() == {1: "front"}


def test_a_state_counts_what_it_left_out(newer: NewerLogs, tmp_path: Path) -> None:
    """A keyframe behind a marked event bears that event's number, as the later version's does."""
    log = sl.read(newer.log("weighed", tmp_path))

    with pytest.warns(NewerLogWarning):
        state = log.replay(event=UNKNOWN)

    assert state.event == UNKNOWN


def test_a_log_of_our_own_has_none(tmp_path: Path) -> None:
    """And what is looked at costs nothing: no chunk is read for it."""
    with sl.create(tmp_path / "office", tz="UTC") as log:
        log.add_door(x=0, y=0, theta=0, width=1)

    assert sl.read(tmp_path / "office")._reader.newer_events == NewerEvents({}, minor=FORMAT_MINOR)
    assert DoorMapState().event == -1


@pytest.mark.parametrize("as_batch", [False, True])
def test_what_is_not_understood_is_not_written_elsewhere(
    newer: NewerLogs, tmp_path: Path, *, as_batch: bool
) -> None:
    """In another log nothing would tell what it is: neither its Channel nor its Schema is there."""
    log = sl.read(newer.log("weighed", tmp_path))
    (commit,) = (c for c in log.follow(2, stop=lambda: True, with_newer=True) if c.batch.objects)

    with sl.create(tmp_path / "other", tz="UTC") as other:
        with pytest.raises(InvalidEventError):
            other.append(commit.batch if as_batch else [log.event(UNKNOWN).event])
        assert other.state.event == -1
