"""What a file of JSON lines means for a log as it stands."""

import gzip
import json

import pytest

from semmap_log.doors import NAN, Door, DoorId, DoorMap, DoorState, Level
from semmap_log.errors import FormatError
from semmap_log.events import Changed, DoorObserved, DoorUpdated, Retracted
from semmap_log.formats import importing_lines
from semmap_log.formats.importing import Present
from semmap_log.formats.importing_lines import plan_event_lines

FRONT = Door(DoorId(3), 2, 0.0, 0.0, 0.0, 1.0, DoorState.OPEN, NAN, NAN,
             annotations={"name": "front"})  # fmt: skip
PRESENT = Present(
    DoorMap({DoorId(3): FRONT}, {2: Level(2, "top")}),
    frozenset({DoorId(3), DoorId(7)}),
    next_event=10,
)
SEEN = {"kind": "DoorObserved", "state": "OPEN"}


def plan(tmp_path, *lines, pack=False):
    text = "\n".join(line if isinstance(line, str) else json.dumps(line) for line in lines) + "\n"
    path = tmp_path / "in.jsonl"
    path.write_bytes(gzip.compress(text.encode()) if pack else text.encode())
    return plan_event_lines(path, PRESENT, tz="UTC")


@pytest.mark.parametrize("pack", [False, True])
def test_lines_are_events_in_their_order(tmp_path, pack):
    """
    Doors by id, by name, by level and name; blank lines mean nothing.
    """
    found = plan(tmp_path, SEEN | {"door_id": 3}, "", SEEN | {"door": "front"},
                 SEEN | {"door": "top/front"}, pack=pack)  # fmt: skip

    assert 3 == found.count
    assert all(isinstance(event, DoorObserved) for event in found.events)
    assert {3} == {event.door_id for event in found.events}


def test_a_line_may_name_a_door_that_an_earlier_one_added(tmp_path):
    """
    The next free id is after all that were ever given; a door's level is remembered.
    """
    added, named, seen, moved = plan(
        tmp_path,
        {"kind": "DoorAdded", "level": 2},
        {"kind": "DoorAnnotated", "door_id": 8, "key": "name", "value": "back"},
        SEEN | {"door": "back"},
        {"kind": "DoorUpdated", "door": "back", "x": 1, "y": 2, "theta": 3, "width": 1},
    ).events

    assert [8, 8, 8, 8] == [event.door_id for event in (added, named, seen, moved)]
    assert isinstance(moved, DoorUpdated)
    assert (Changed.POSE | Changed.WIDTH, 2) == (moved.changed, moved.level)


def test_every_wrong_line_is_told(tmp_path):
    """
    All at once, each with its number.
    """
    with pytest.raises(FormatError) as caught:
        plan(
            tmp_path,
            SEEN | {"door_id": 99},
            "nonsense",
            {"kind": "DoorAdded", "door_id": 3},
            {"kind": "DoorAdded", "door_id": 7},
            SEEN | {"door": "cellar"},
        )

    found = str(caught.value).splitlines()
    expected = ["door 99 is not in the map",
                "expected one JSON object", "door 3 is in the map already",
                "door 7 was removed", "no door has the name 'cellar'"]  # fmt: skip
    assert 5 == len(found)
    for number, (line, part) in enumerate(zip(found, expected, strict=True), start=1):
        assert f"in.jsonl:{number}: " in line
        assert 1 == line.count("in.jsonl")
        assert part in line


def test_retractions_of_another_log_are_left_out_and_said(tmp_path):
    """
    Their numbers are of that log's events; one written by hand means this one's.
    """
    hide = {"kind": "Retracted", "first_event": 1, "last_event": 2}

    found = plan(tmp_path, hide | {"event": 3}, hide)

    assert [Retracted(first_event=1, last_event=2)] == list(found.events)
    assert 1 == len(found.left_out)
    assert "line 1: Retracted" in found.left_out[0]


def test_who_and_why_of_single_lines_is_said_to_be_lost(tmp_path):
    """
    An import is one commit.
    """
    found = plan(tmp_path, SEEN | {"door_id": 3, "actor": "eva"})

    assert (
        "lines that say who or why: 1; an import is one commit, with one note",
    ) == found.warnings


def test_a_large_file_is_read_anew_each_time_and_may_not_change(tmp_path, monkeypatch):
    """
    Its events are not kept, they are too many; what was counted must still be there.
    """
    monkeypatch.setattr(importing_lines, "MOST_KEPT", 1)
    found = plan(tmp_path, SEEN | {"door_id": 3}, SEEN | {"door_id": 3})
    path = tmp_path / "in.jsonl"
    text = path.read_text()

    assert 2 == len(list(found.events)) == len(list(found.events))
    path.write_text(text + json.dumps(SEEN | {"door_id": 3}))
    with pytest.raises(FormatError, match=r"in.jsonl: the file changed while it was imported"):
        list(found.events)
    path.write_text(text.replace("OPEN", "AJAR"))
    with pytest.raises(FormatError, match=r"in.jsonl:1: "):
        list(found.events)
