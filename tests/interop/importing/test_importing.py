"""What a file of doors means for a log as it stands."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semmap_log.core.model.doors import (
    MAX_DOOR_ID,
    NAN,
    Door,
    DoorId,
    DoorMap,
    DoorState,
    Level,
    RemovedDoor,
)
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorUpdated,
    FloorMap,
    LevelAdded,
    Retracted,
)
from semmap_log.errors import CommandError, DoorExistsError, DoorRemovedError
from semmap_log.interop.formats.files.door_table import DoorTable, TableDoor
from semmap_log.interop.formats.files.thesis_yaml import dump_thesis_yaml, parse_thesis_yaml
from semmap_log.interop.formats.parsing.strict_yaml import parse_yaml
from semmap_log.interop.importing.import_plan import Present, plan_doors

FILE = Path("doors.yaml")


def door(door_id=1, **values):
    known = {"level": 0, "x": 1.0, "y": 2.0, "theta": 0.5, "width": 0.9, "state": DoorState.OPEN,
             "prob_open": 0.25, "prob_closed": 0.75} | values  # fmt: skip
    return Door(DoorId(door_id), **known)


def row(door_id=1, line=3, **values):
    known = {"level": 0, "x": 1.0, "y": 2.0, "theta": 0.5, "width": 0.9, "state": DoorState.OPEN,
             "prob_open": 0.25, "prob_closed": 0.75} | values  # fmt: skip
    return TableDoor(line=line, door_id=door_id and DoorId(door_id), **known)


def table(*rows, **values):
    return DoorTable(FILE, rows, **values)


def present(*doors, used=(), levels=(), floor_maps=None):
    ids = {found.door_id for found in doors} | set(map(DoorId, used))
    door_map = DoorMap({d.door_id: d for d in doors}, {level.level: level for level in levels})
    return Present(door_map, frozenset(ids), floor_maps or {})


def test_ids_of_a_file_are_kept_where_they_are_free():
    """With all their values, at the moment asked for."""
    plan = plan_doors(table(row(7)), present(door(1)), at_ns=5)

    assert [
        DoorAdded(door_id=DoorId(7), x=1.0, y=2.0, theta=0.5, width=0.9, state=DoorState.OPEN,
                  prob_open=0.25, prob_closed=0.75, happened_ns=5)
    ] == list(plan.events)  # fmt: skip
    assert (1, ("doors: 1 added",)) == (plan.count, plan.summary)


def test_a_door_with_the_same_values_is_left_alone():
    """What the file does not give does not differ; MOVING leaves the thesis's YAML as UNKNOWN."""
    plan = plan_doors(
        table(
            row(1),
            row(2, prob_open=NAN, state=None),
            row(3, state=DoorState.UNKNOWN),
        ),
        present(door(1), door(2), door(3, state=DoorState.MOVING)),
    )

    assert (0, ("doors: 3 the same already",)) == (plan.count, plan.summary)


def test_what_was_exported_changes_nothing_when_it_comes_back():
    """Through the thesis's text, unplaced doors and a door on a level included."""
    doors = present(door(1), door(2, level=3, state=DoorState.OFFLINE),
                    door(3, x=NAN, y=NAN, theta=NAN, width=NAN))  # fmt: skip
    text, _ = dump_thesis_yaml(doors.door_map)

    back = parse_thesis_yaml(parse_yaml(text.encode(), FILE), FILE)

    assert 0 == plan_doors(back, doors).count


def test_other_values_are_an_error_that_lists_them():
    """Every such door, with its line in the file, and how to go on."""
    with pytest.raises(DoorExistsError) as caught:
        plan_doors(table(row(1, x=4.0), row(2, line=12, state=DoorState.CLOSED)),
                   present(door(1), door(2)))  # fmt: skip

    assert (
        "doors.yaml:3: door 1 is there with other values: x 1.0 there, 4.0 in the file\n"
        "doors.yaml:12: door 2 is there with other values: state OPEN there, CLOSED in the file\n"
        "Nothing was imported; write the file's values with --update."
    ) == str(caught.value)


def test_update_writes_the_fields_that_differ():
    """A position stays on its level."""
    plan = plan_doors(
        table(row(1, x=4.0, prob_closed=0.5), row(2)), present(door(1, level=2), door(2)),
        update=True,
    )  # fmt: skip

    (event,) = plan.events
    assert isinstance(event, DoorUpdated)
    assert Changed.POSE | Changed.PROB_CLOSED == event.changed
    assert (2, 4.0, 2.0, 0.5, 0.5) == (event.level, event.x, event.y, event.theta,
                                       event.prob_closed)  # fmt: skip
    assert ("doors: 1 updated, 1 the same already",) == plan.summary


def test_update_places_an_unplaced_door_as_a_whole():
    """Pose and width come together."""
    there = door(1, x=NAN, y=NAN, theta=NAN, width=NAN)

    (event,) = plan_doors(table(row(1)), present(there), update=True).events

    assert isinstance(event, DoorUpdated)
    assert Changed.POSE | Changed.WIDTH == event.changed


def test_an_id_that_was_removed_is_an_error():
    """Two doors must not share a history. One whose adding was taken back never comes back."""
    gone = replace(present(door(1), used=[5, 6]), removed={5: RemovedDoor(door(5), 17)})

    with pytest.raises(DoorRemovedError) as caught:
        plan_doors(table(row(5), row(6, line=9)), gone)
    with pytest.raises(DoorRemovedError, match=r"taken back .*\n.*; give .* --renumber"):
        plan_doors(table(row(5), row(6)), gone, update=True)

    assert (
        "doors.yaml:3: door 5 was removed, by event 17\n"
        "doors.yaml:9: door 6 was taken back with its adding\n"
        "Nothing was imported; bring doors that were removed back with --update, or give such "
        "doors new ids with --renumber."
    ) == str(caught.value)


def test_update_brings_a_removed_door_back():
    """Its removal is taken back, and what differs from what it was then is written."""
    gone = replace(present(door(1), used=[5]), removed={5: RemovedDoor(door(5, level=2), 17)})

    same = plan_doors(table(row(5)), gone, update=True)
    moved = plan_doors(table(row(5, x=4.0)), gone, update=True)
    another = plan_doors(table(row(5)), gone, update=True, renumber=True)

    assert [Retracted(first_event=17, last_event=17)] == list(same.events)
    _, update = moved.events
    assert isinstance(update, DoorUpdated)
    assert (5, Changed.POSE, 2, 4.0) == (update.door_id, update.changed, update.level, update.x)
    assert ("doors: 1 brought back",
            "door 5: its removal, event 17, is taken back") == moved.summary  # fmt: skip
    assert [6] == [event.door_id for event in another.events]


def test_renumber_gives_such_doors_the_next_free_ids():
    """Free of the file's own ids, too."""
    plan = plan_doors(table(row(5), row(9), row(2)), present(door(1), used=[2, 5]), renumber=True)

    assert [10, 9, 11] == [event.door_id for event in plan.events]
    assert ("doors: 3 added", "door 5 of the file is door 10 in the log",
            "door 2 of the file is door 11 in the log") == plan.summary  # fmt: skip


def test_behind_the_last_id_come_those_that_were_never_given():
    """Never wrapped, never given twice."""
    plan = plan_doors(table(row(None), row(None), row(4)), present(used=[1, MAX_DOOR_ID]))

    assert {2, 3, 4} == {event.door_id for event in plan.events if isinstance(event, DoorAdded)}


# Buildings


def building(*rows, maps=()):
    return table(
        *rows,
        levels=(Level(1, "L1", 0.0), Level(2, "L2", 4.0)),
        floor_maps=tuple(maps),
        left_out=("lift a: it serves no level by a door",),
    )


def named(name, level=1, **values):
    return row(None, level=level, state=None, prob_open=NAN, prob_closed=NAN,
               annotations={"name": name, "kind": "hinged"}, **values)  # fmt: skip


PLAN = FloorMap(level=2, resolution=0.05, origin_x=0.0, origin_y=0.0, cells=np.zeros((2, 2), "i1"))


def test_a_building_comes_with_levels_names_and_plans():
    """Levels that are there by name are used, others numbered on; so are the doors."""
    log = present(door(4), levels=[Level(3, "L2")])

    plan = plan_doors(building(named("front"), named("back", level=2), maps=[PLAN]), log)

    events = list(plan.events)
    assert [LevelAdded, DoorAdded, DoorAnnotated, DoorAnnotated, DoorAdded, DoorAnnotated,
            DoorAnnotated, FloorMap] == [type(event) for event in events]  # fmt: skip
    assert LevelAdded(level=4, name="L1", elevation=0.0) == events[0]
    assert (DoorId(5), 4, DoorState.UNKNOWN) == (
        events[1].door_id, events[1].level, events[1].state)  # fmt: skip
    assert DoorAnnotated(door_id=DoorId(5), key="name", value="front") == events[2]
    assert DoorAnnotated(door_id=DoorId(5), key="kind", value="hinged") == events[3]
    assert (DoorId(6), 3) == (events[4].door_id, events[4].level)
    assert replace(PLAN, level=3) == events[7]
    assert ("lift a: it serves no level by a door",) == plan.left_out


def test_a_building_that_is_there_changes_nothing():
    """Doors are known by level and name, plans by their cells."""
    notes = {"name": "front", "kind": "hinged"}
    log = present(
        door(8, level=3, annotations=notes), door(9, level=2, annotations=notes),
        levels=[Level(2, "L1"), Level(3, "L2")],
        floor_maps={3: replace(PLAN, level=3, happened_ns=77)},
    )  # fmt: skip

    plan = plan_doors(building(named("front"), named("front", level=2), maps=[PLAN]), log)

    assert 0 == plan.count


def test_a_building_with_a_moved_door_is_an_error_or_an_update():
    """Its kind, too; the state is not the building's to say."""
    there = door(8, level=1, annotations={"name": "front", "kind": "sliding"})
    log = present(there, levels=[Level(1, "L1"), Level(2, "L2")])
    file = building(named("front", x=3.0))

    with pytest.raises(DoorExistsError, match=r"x 1.0 there, 3.0"):
        plan_doors(file, log)
    moved, annotated = plan_doors(file, log, update=True).events
    assert Changed.POSE == moved.changed
    assert DoorAnnotated(door_id=DoorId(8), key="kind", value="hinged") == annotated


def test_a_name_that_two_doors_bear_is_an_error():
    """Which of them is meant?"""
    notes = {"name": "front"}
    log = present(door(1, level=1, annotations=notes), door(2, level=1, annotations=notes),
                  levels=[Level(1, "L1")])  # fmt: skip

    with pytest.raises(CommandError, match="2 doors called 'front'"):
        plan_doors(building(named("front")), log)
