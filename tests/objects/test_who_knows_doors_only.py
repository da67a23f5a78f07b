"""The thesis, planners and lasers know doors alone: of objects that are none they see nothing."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.analysis.rooms import rooms_of
from semmap_log.core.model.events import ClassDefined, FloorMap
from semmap_log.errors import CommandError
from semmap_log.interop.exporting.log_files import export
from semmap_log.interop.exporting.stream_topics import LatestDoors, LevelDoors, ThesisDoors
from semmap_log.interop.formats.ros.door_messages import DoorMarkers, ThesisMessages
from semmap_log.interop.importing.importing import ImportOptions, import_file
from semmap_log.interop.topics.lasers.door_places import changes_places, places_of
from semmap_log.live.planners.door_view import DoorView
from semmap_log.live.ros.serving.yaml_start import start_with_yaml
from semmap_log.views.palette import DEFAULT


def test_the_thesis_yaml_has_doors_and_says_what_it_leaves_out(
    log: sl.DoorLogWriter, tmp_path: Path
) -> None:
    done = export(log, tmp_path / "doors.yaml", default_prob=0.5)

    assert "1 door" == done.what
    assert ("dock 2 (west)", "shutter 3 (bay)", "spill 4") == tuple(
        text.partition(": is no door, and this format knows nothing else")[0]
        for text in done.left_out
    )
    assert ["1:"] == [line for line in (tmp_path / "doors.yaml").read_text("utf-8").splitlines()
                      if not line.startswith(" ")]  # fmt: skip


def test_a_server_that_starts_with_such_a_yaml_keeps_the_rest(
    log: sl.DoorLogWriter, tmp_path: Path
) -> None:
    """It is the log's own; and in one that knows another door, a dock is nothing that has gone."""
    export(log, tmp_path / "doors.yaml", default_prob=0.5)
    text = (tmp_path / "doors.yaml").read_text("utf-8")
    said = start_with_yaml(log, tmp_path / "doors.yaml", default_prob=0.5)
    assert ["as in the log" in line for line in said] == [True]

    (tmp_path / "doors.yaml").write_text(text.replace("1:\n", "9:\n"), "utf-8")
    start_with_yaml(log, tmp_path / "doors.yaml", default_prob=0.5, replace=True)

    assert {2: "dock", 3: "shutter", 4: "spill", 9: "door"} == {
        int(i): door.object_class.name for i, door in log.replay().doors.items()
    }


@pytest.mark.parametrize("update", [False, True])
def test_files_of_doors_change_no_dock(log: sl.DoorLogWriter, tmp_path: Path, update: bool) -> None:
    """One that has its number says so, and nothing comes in."""
    entry = "  position: {x: 7.0, y: 1.0, theta: 0.0}\n  width: 1.0\n  status: CLOSED\n"
    (tmp_path / "doors.yaml").write_text(f"2:\n{entry}", "utf-8")
    before = log.last_event()

    with pytest.raises(CommandError, match="west, number 2, is a dock in the log, and no door"):
        import_file(log, tmp_path / "doors.yaml", ImportOptions(update=update))
    assert before == log.last_event()


@pytest.mark.parametrize("version", [1, 2])
def test_the_thesis_message_has_doors_and_markers_all(log: sl.DoorLogWriter, version: int) -> None:
    thesis = ThesisDoors(ThesisMessages(version, None))  # type: ignore[arg-type]
    drawn = LevelDoors(DoorMarkers(version), 0, DEFAULT)  # type: ignore[arg-type]
    doors = LatestDoors.of(log.replay()).doors

    assert [1] == [i for i, door in doors.items() if thesis.show(i, door)]
    assert [1, 2, 3, 4] == [i for i, door in doors.items() if drawn.show(i, door, 0.0)]


def test_what_is_no_line_has_no_length(log: sl.DoorLogWriter) -> None:
    """A door that was taken for one, and is a dock: no marker goes on as wide as it was."""
    log.annotate("front", "class", "dock")
    look = LevelDoors(DoorMarkers(2), 0, DEFAULT)._look(log.replay().doors[sl.DoorId(1)], 0.0)
    door = log.replay().doors[sl.DoorId(1)]

    assert (0.0, door.start) == (look.width, door.end)


def test_events_in_their_order_tell_the_same_doors(log: sl.DoorLogWriter) -> None:
    """As a replay, event by event: what streams of messages are made of."""
    log.observe("west", "taken")
    log.define_class("dock", geometry="segment", states="empty,full")
    log.annotate("bay", "class", "spill")
    known = LatestDoors()

    for entry in log.history():
        known.take(entry.event)
        there = log.replay(event=entry.number).doors
        assert {i: (d.object_class, d.state_word, d.outline) for i, d in there.items()} == {
            i: (d.object_class, d.state_word, d.outline) for i, d in known.doors.items()
        }


def test_planners_and_lasers_see_doors(log: sl.DoorLogWriter) -> None:
    view = DoorView(log.replay())

    assert [1] == view.ids()
    assert [1] == view.ids(sl.DoorState.OPEN)
    assert view.find("west") is None
    assert view.find("DOOR_2") is None
    assert [1] == places_of(log.replay().doors.values()).ids.tolist()
    assert changes_places(ClassDefined(class_name="dock", geometry="point"))


def test_rooms_are_cut_by_doors(log: sl.DoorLogWriter) -> None:
    """A shutter over the whole width makes no second room, and a spill none."""
    cells = np.zeros((40, 80), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    log.append([FloorMap(level=0, resolution=0.1, origin_x=0.0, origin_y=-1.0, cells=cells)])
    log.add_door(object_class="shutter", x=3.0, y=-1.0, theta=np.pi / 2, width=4.0)

    assert 1 == len(rooms_of(log).rooms)
    assert [1] == list(rooms_of(log).doorways)


def test_other_files_have_all_of_them(log: sl.DoorLogWriter, tmp_path: Path) -> None:
    """GeoJSON by their geometry; a class of them alone, where it is asked for."""
    done = export(log, tmp_path / "all.geojson")
    shown = json.loads((tmp_path / "all.geojson").read_text("utf-8"))
    assert ["LineString", "Point", "LineString", "Polygon"] == [
        feature["geometry"]["type"] for feature in shown["features"]
    ]
    ring = shown["features"][3]["geometry"]["coordinates"][0]
    assert ring == [[1.0, 3.0], [3.0, 3.0], [3.0, 4.0], [1.0, 3.0]]
    assert "4 doors" in done.what

    log.add_door(object_class="spill", outline=[(0, 0), (0, 1), (1, 0)])  # the other way round
    export(log, tmp_path / "some.geojson", object_class="spill")
    export(log, tmp_path / "docks.csv", object_class="dock")
    some = json.loads((tmp_path / "some.geojson").read_text("utf-8"))["features"]
    assert [4, 5] == [feature["id"] for feature in some]
    ring = some[1]["geometry"]["coordinates"][0]
    assert 0 < sum(a[0] * b[1] - b[0] * a[1] for a, b in pairwise(ring))
    rows = (tmp_path / "docks.csv").read_text("utf-8").splitlines()[1:]
    assert ["west,OPEN"] == [",".join(row.split(",")[1:3]) for row in rows]
