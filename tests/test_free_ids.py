"""The id of a new door, where somebody has given the greatest there can be."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import MAX_DOOR_ID, DoorId, next_door_id
from semmap_log.interop.importing.importing import ImportOptions, import_file
from semmap_log.interop.topics.topic_reader import Known


@pytest.mark.parametrize(
    ("used", "given"),
    [
        (set(), 1),
        ({0}, 1),
        ({1, 2, 7}, 8),
        ({MAX_DOOR_ID - 1}, MAX_DOOR_ID),
        ({MAX_DOOR_ID}, 1),
        ({1, 2, 4, MAX_DOOR_ID - 1, MAX_DOOR_ID}, 3),
    ],
)
def test_the_next_id_is_behind_the_greatest_while_there_is_one(used: set[int], given: int) -> None:
    """Then the lowest that was never given; never 0, never one twice."""
    assert given == next_door_id(used, max(used, default=0))


def test_one_great_id_does_not_end_the_adding(tmp_path: Path) -> None:
    """By each way in which a door gets its id; those of removed doors are not free."""
    (tmp_path / "lines.jsonl").write_text('{"kind": "DoorAdded"}\n{"kind": "DoorAdded"}\n')
    (tmp_path / "seen.csv").write_text(
        "timestamp,door,state\n2026-03-01T08:00,a,OPEN\n2026-03-01T09:00,b,OPEN\n"
    )
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
        log.remove_door(DoorId(1))
        log.add_door(door_id=DoorId(MAX_DOOR_ID))

        assert 2 == log.add_door(name="front")
        assert 3 == Known.of(log).next_id == log.door_index.next_free_id
        import_file(log, tmp_path / "lines.jsonl")
        import_file(log, tmp_path / "seen.csv", ImportOptions(new_doors=True))

        assert [2, 3, 4, 5, 6, MAX_DOOR_ID] == sorted(log.replay().doors)
        assert 7 == Known.of(log).next_id_but({8})
        assert 9 == Known.of(log).next_id_but({7, 8})
