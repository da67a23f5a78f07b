"""The doors of a map, however they are asked for."""

from __future__ import annotations

from pathlib import Path

import semmap_log as sl
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.levels import DoorsPresent
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, DoorRemoved
from tests.batches import batch_of


def test_ids_ascend_whichever_door_was_asked_for_first(tmp_path: Path) -> None:
    """Once each was asked for by itself, the last first."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.append([DoorAdded(door_id=DoorId(n)) for n in (1, 2, 3)])
        doors = log.replay().doors

    for n in (3, 2, 1):
        assert n == doors[DoorId(n)].door_id

    assert [1, 2, 3] == [door.door_id for door in doors.values()]
    assert [1, 2, 3] == [door_id for door_id, _ in doors.items()]


def test_doors_by_state_and_by_name() -> None:
    """A state that only a later version knows is UNKNOWN."""
    state = DoorMapState()
    added = [DoorAdded(door_id=DoorId(i), state=DoorState.OPEN) for i in (3, 1, 2, 4)]
    named = [DoorAnnotated(door_id=DoorId(i), key="name", value=f"d{i}") for i in (2, 4)]
    state.apply(batch_of([*added, *named, DoorRemoved(door_id=DoorId(4))]))
    state._columns["state"][state._row_of[2]] = 77
    doors = state.door_map().doors

    assert isinstance(doors, DoorsPresent)
    assert [1, 3] == doors.in_state(DoorState.OPEN)
    assert [2] == doors.in_state(DoorState.UNKNOWN)
    assert {2: "d2"} == doors.names()
    assert DoorState.UNKNOWN is doors[DoorId(2)].state
