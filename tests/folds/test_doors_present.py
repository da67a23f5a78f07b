"""The doors of a map, however they are asked for."""

from __future__ import annotations

from pathlib import Path

import semmap_log as sl
from semmap_log.domain.doors import DoorId
from semmap_log.domain.events import DoorAdded


def test_ids_ascend_whichever_door_was_asked_for_first(tmp_path: Path) -> None:
    """
    Once each was asked for by itself, the last first.
    """
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.append([DoorAdded(door_id=DoorId(n)) for n in (1, 2, 3)])
        doors = log.replay().doors

    for n in (3, 2, 1):
        assert n == doors[DoorId(n)].door_id

    assert [1, 2, 3] == [door.door_id for door in doors.values()]
    assert [1, 2, 3] == [door_id for door_id, _ in doors.items()]
