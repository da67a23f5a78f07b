"""What a door CSV means for a log as it stands."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.core.batches.event_batch import one_by_one
from semmap_log.core.model.doors import NAN, Door, DoorId, DoorMap, DoorState, Level, RemovedDoor
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorUpdated,
)
from semmap_log.errors import UnknownDoorError
from semmap_log.interop.formats.files import csv_blocks
from semmap_log.interop.formats.files.door_csv import read_door_csv
from semmap_log.interop.importing.held_sightings import plan_sightings
from semmap_log.interop.importing.import_plan import Present

ROWS = "1970-01-01T00:00:05,front,OPEN,0.9\n1970-01-01T00:00:06,front,CLOSED,\n"


def rows(tmp_path, text=ROWS):
    path = tmp_path / "doors.csv"
    path.write_text(f"timestamp,door,state,accuracy\n{text}")
    return read_door_csv(path, tz="UTC")


def door(door_id, name=None, level=0):
    return Door(DoorId(door_id), level, 0.0, 0.0, 0.0, 1.0, DoorState.OPEN, NAN, NAN,
                annotations={"name": name} if name else {})  # fmt: skip


def present(*doors, used=(), levels=()):
    ids = {found.door_id for found in doors} | set(map(DoorId, used))
    return Present(DoorMap({d.door_id: d for d in doors}, {lv.level: lv for lv in levels}),
                   frozenset(ids))  # fmt: skip


def with_removed(found, *removed):
    gone = {door.door_id: RemovedDoor(door, 10 + door.door_id) for door in removed}
    return replace(found, removed=gone, used_ids=found.used_ids | gone.keys())


def meant(plan):
    return {event.door_id for event in one_by_one(plan.events)}


def test_a_new_name_is_a_new_unplaced_door(tmp_path):
    """Added when its first row happened, so that no event lies before it."""
    plan = plan_sightings(rows(tmp_path), present(door(3), used=[8]), new_doors=True)

    nine = DoorId(9)
    expected = [
        DoorAdded(door_id=nine, happened_ns=5 * 10**9),
        DoorAnnotated(door_id=nine, key="name", value="front", happened_ns=5 * 10**9),
        DoorObserved(door_id=nine, state=DoorState.OPEN, accuracy_open=0.9, accuracy_closed=0.9,
                     happened_ns=5 * 10**9),
        DoorUpdated(door_id=nine, changed=Changed.STATE, state=DoorState.CLOSED,
                    happened_ns=6 * 10**9),
    ]  # fmt: skip
    assert list(map(repr, expected)) == list(map(repr, one_by_one(plan.events)))
    assert plan.count == len(list(one_by_one(plan.events)))
    assert "1 new, without a place yet" in plan.summary[0]


@pytest.mark.parametrize(
    ("name", "level", "expected"),
    [
        ("front", None, 1),
        ("L2/back", None, 3),
        ("back", 2, 3),
        ("back", 1, 2),
        ("front", 2, 6),
        ("4", None, 4),
        ("1", 1, 6),
        ("L2/front", None, 5),
    ],
)
def test_which_door_a_name_means(tmp_path, name, level, expected):
    """A name before level/name before the id of a door without a name; else a new one, here 6."""
    doors = present(door(1, "front", 1), door(2, "back", 1), door(3, "back", 2), door(4),
                    door(5, "L2/front", 1), levels=[Level(1, "L1"), Level(2, "L2")])  # fmt: skip

    plan = plan_sightings(
        rows(tmp_path, ROWS.replace("front", name)), doors, level=level, new_doors=True
    )

    assert {expected} == meant(plan)


def test_a_name_that_several_doors_bear_asks_for_the_level(tmp_path):
    """Instead of taking any of them."""
    doors = present(door(1, "front", 1), door(2, "front", 2))

    with pytest.raises(UnknownDoorError, match=r"name of 2 doors \(1, 2\)"):
        plan_sightings(rows(tmp_path), doors)


@pytest.mark.parametrize(
    ("called", "hint"), [("fron", r" \(did you mean 'fron'\?\)"), ("yard", "")]
)
def test_a_name_of_no_door_is_asked_about_in_a_log_that_has_doors(tmp_path, called, hint):
    """It may be mistyped. In a log that has none it is a new door's."""
    found, doors = rows(tmp_path), present(door(3, called))

    with pytest.raises(UnknownDoorError, match=rf"no door is called 'front'{hint}; .* --new-doors"):
        plan_sightings(found, doors)
    assert {DoorId(4)} == meant(plan_sightings(found, doors, new_doors=True))
    assert {DoorId(1)} == meant(plan_sightings(found, present()))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 6), st.booleans()), min_size=1, max_size=60))
def test_doors_are_added_before_their_first_rows(tmp_path_factory, drawn):
    """However the rows fall into blocks; known doors are not added again."""
    lines = [
        f"1970-01-01T00:{i:02}:00,door {name},OPEN,{'0.9' if sighted else ''}\n"
        for i, (name, sighted) in enumerate(drawn)
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(csv_blocks, "BLOCK_BYTES", 120)
        found = rows(tmp_path_factory.mktemp("csv"), "".join(lines))

    plan = plan_sightings(found, present(door(1, "door 0"), door(2, "door 3")), new_doors=True)

    ids, expected = {"door 0": 1, "door 3": 2}, []
    for name, sighted in drawn:
        if f"door {name}" not in ids:
            ids[f"door {name}"] = len(ids) + 1
            expected += [("DoorAdded", ids[f"door {name}"]), ("DoorAnnotated", ids[f"door {name}"])]
        expected.append((("DoorUpdated", "DoorObserved")[sighted], ids[f"door {name}"]))
    events = list(one_by_one(plan.events))
    assert expected == [(type(event).__name__, event.door_id) for event in events]
    assert plan.count == len(events)


LEVELS = (Level(1, "L1"), Level(2, "L2"))


@pytest.mark.parametrize("level", [None, 1, 2])
def test_a_name_with_its_level_means_that_door(tmp_path, level):
    """Whatever level is told for those without one, and for new ones."""
    text = ROWS.replace("front", "L2/front")
    found = present(door(1, "front", 1), door(3, "front", 2), levels=LEVELS)

    assert {DoorId(3)} == meant(plan_sightings(rows(tmp_path, text), found, level=level))


def test_a_level_without_such_a_door_is_told(tmp_path):
    """A slip of the pen makes no door."""
    text = ROWS.replace("front", "L2/fornt")
    found = present(door(3, "front", 2), levels=LEVELS)

    with pytest.raises(UnknownDoorError, match="'L2/fornt': level L2"):
        plan_sightings(rows(tmp_path, text), found, level=2)


def test_new_doors_are_named(tmp_path):
    """So that a slip of the pen is seen."""
    text = "".join(ROWS.replace("front", f"door {i}") for i in range(5))

    said = plan_sightings(rows(tmp_path, text), present()).summary[0]

    assert "'door 0', 'door 1', 'door 2' and 2" in said


def test_a_name_that_a_removed_door_bore_means_that_door(tmp_path):
    """Its past belongs to it; a new door of the name is made where that is asked for."""
    found = with_removed(present(door(2, "back")), door(1, "front"))

    assert {DoorId(1)} == meant(plan_sightings(rows(tmp_path), found))
    assert {DoorId(3)} == meant(
        plan_sightings(rows(tmp_path), found, renumber=True, new_doors=True)
    )


def test_a_door_that_is_there_goes_before_one_that_was_removed(tmp_path):
    """Of the same name."""
    found = with_removed(present(door(2, "front")), door(1, "front"))

    assert {DoorId(2)} == meant(plan_sightings(rows(tmp_path), found))
