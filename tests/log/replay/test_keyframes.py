"""Keyframes compared with the replay, in logs in which much was taken back."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, Retracted
from semmap_log.log.replay.maintenance import verify
from tests.log.replay.test_state import START_NS, sightings, tiny_steps


def test_retractions_of_what_was_overwritten_do_not_begin_it_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The oldest sightings are taken back one by one: the events are folded twice, not 20 times."""
    path = tmp_path / "log"
    with tiny_steps(), sl.create(path, tz="UTC", compact=False) as log:
        log.append([DoorAdded(door_id=DoorId(1), happened_ns=START_NS - 1)])
        for n in range(20):
            log.append(sightings(20, start=20 * n))
            log.append([Retracted(first_event=n + 1, last_event=n + 1)])
    folded: list[int] = []
    apply = DoorMapState.apply

    def counted(state: DoorMapState, batch: EventBatch) -> None:
        folded.append(len(batch))
        apply(state, batch)

    monkeypatch.setattr(DoorMapState, "apply", counted)

    found = verify(path)

    assert (0, 421) == (found.exit_code, found.events)
    assert sum(folded) < 3 * found.events
