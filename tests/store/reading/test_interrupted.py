"""A question that was cut short, or asked by two threads at once, leaves the next answer right."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.batches.event_batch import EventBatch, Retractions
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, Retracted
from semmap_log.log.replay.keyframes import encode
from semmap_log.log.replay.state import state_at
from semmap_log.store.reading.reader import LogReader
from tests.log.replay.test_state import START_NS, sightings, tiny_steps


def test_retractions_read_in_part_are_not_taken_for_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C while they are gathered: the same log then says what a new one says."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", compact=False) as log:
        log.append([DoorAdded(door_id=DoorId(1), happened_ns=START_NS, state=DoorState.OPEN)])
        log.append(sightings(1, start=1))
        log.append([Retracted(first_event=1, last_event=1)])

    def interrupted(_: Retractions, __: EventBatch) -> None:
        raise KeyboardInterrupt

    log = sl.read(path)
    with monkeypatch.context() as patch:
        patch.setattr(Retractions, "apply", interrupted)
        with pytest.raises(KeyboardInterrupt):
            log.replay()

    assert DoorState.OPEN is log.replay().doors[DoorId(1)].state


def test_a_fold_cut_short_does_not_become_a_keyframe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C while a writer takes in what it wrote: its later keyframes are right."""
    path = tmp_path / "log"

    def interrupted(state: DoorMapState, batch: EventBatch) -> None:
        state.event = int(batch.number.max())
        raise KeyboardInterrupt

    with tiny_steps(), sl.create(path, tz="UTC") as log:
        log.append([DoorAdded(door_id=DoorId(1), happened_ns=START_NS - 1)])
        log.append(sightings(3))
        with monkeypatch.context() as patch:
            patch.setattr(DoorMapState, "apply", interrupted)
            with pytest.raises(KeyboardInterrupt):
                assert log.state
        for n in range(5):
            log.append([DoorObserved(door_id=DoorId(1), state=DoorState.OPEN,
                                     happened_ns=START_NS - 2)] * (n + 1))  # fmt: skip

    reader = LogReader(path)
    assert encode(state_at(reader, uses_keyframes=False)) == encode(state_at(reader))


def test_a_slow_refresh_does_not_take_back_a_fast_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two threads refresh one log: who has seen an event does not see it go."""
    refreshed = LogReader.refreshed
    has_looked, may_return = threading.Event(), threading.Event()

    def slow(reader: LogReader) -> LogReader:
        found = refreshed(reader)
        if threading.current_thread() is first:
            has_looked.set()
            may_return.wait(100)
        return found

    with sl.create(tmp_path / "log", tz="UTC") as writer:
        log = sl.read(tmp_path / "log")
        monkeypatch.setattr(LogReader, "refreshed", slow)
        first, second = threading.Thread(target=log.refresh), threading.Thread(target=log.refresh)
        first.start()
        has_looked.wait(100)
        writer.append([DoorAdded(door_id=DoorId(1))])
        second.start()
        second.join(0.2)  # it is through, or waits for the first
        may_return.set()
        first.join(100)
        second.join(100)

        assert DoorId(1) in log.replay().doors
