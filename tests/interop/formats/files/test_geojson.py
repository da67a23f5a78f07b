"""Doors as GeoJSON: what RFC 7946 asks of the form, and what it must not be taken for."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import pytest

from semmap_log.core.model.doors import NAN, Door, DoorId, DoorMap, DoorState, Level
from semmap_log.interop.formats.files.geojson import dump_geojson
from semmap_log.interop.formats.json.door_json import door_map_to_json

NOON_NS = 1_772_366_400 * 10**9


def door(number: int, x: float = 1.0, width: float = 2.0, **more: Any) -> Door:
    return Door(DoorId(number), 2, x, 5.0, math.pi / 2, width, DoorState.OPEN, 0.25, NAN, **more)


FRONT = door(3, last_seen_ns=NOON_NS, last_event=8, annotations={"name": "Tür", "kind": "hinged"})
CONTACT = door(7, x=NAN, width=NAN)
FAR = replace(door(7, x=1.7e308, width=1.7e308), theta=0.0)
"""Its other end is beyond all numbers."""
DOORS = DoorMap({DoorId(7): CONTACT, DoorId(3): FRONT}, {2: Level(2, "top", 4.5)}, event=9,
                latest_ns=NOON_NS)  # fmt: skip


def dumped(doors: DoorMap = DOORS) -> Any:
    return json.loads(dump_geojson(doors, {"building": "lab"})[0])


def test_each_door_is_a_line_with_what_the_map_says_of_it() -> None:
    """From its pose along its width; the properties are those of `replay --json`."""
    front, contact = dumped()["features"]

    assert {"type", "id", "geometry", "properties"} == front.keys()
    assert ("Feature", 3, "LineString") == (front["type"], front["id"], front["geometry"]["type"])
    assert [[1.0, 5.0], pytest.approx([1.0, 7.0])] == front["geometry"]["coordinates"]
    by_id = {shown["door_id"]: shown for shown in door_map_to_json(DOORS)["doors"]}
    assert by_id == {f["id"]: f["properties"] for f in (front, contact)}
    assert ("top", 2, "OPEN", 0.25, None, 2.0, {"name": "Tür", "kind": "hinged"}) == tuple(
        front["properties"][key]
        for key in ("level_name", "level", "state", "prob_open", "prob_closed", "width",
                    "annotations")
    )  # fmt: skip


@pytest.mark.parametrize("without", [CONTACT, FAR])
def test_a_door_without_a_place_has_no_geometry(without: Door) -> None:
    """Null, as RFC 7946 has it for what is not located; it is named."""
    text, unplaced = dump_geojson(DoorMap({DoorId(7): without}, {}), {})

    (feature,) = json.loads(text)["features"]
    assert feature["geometry"] is None
    assert 7 == feature["properties"]["door_id"]
    assert [without] == unplaced


def test_nobody_can_take_the_coordinates_for_those_of_the_earth() -> None:
    """GDAL reads the plane's own text; people read words."""
    found = dumped()
    said = found["semmap_log"]

    assert found["crs"]["properties"]["name"].startswith('LOCAL_CS["robot map frame",')
    assert 'UNIT["metre",1]' in found["crs"]["properties"]["name"]
    assert "not longitude and latitude" in said["coordinates"]
    assert ("map", "m", "lab", 9, None) == tuple(
        said[key] for key in ("frame", "unit", "building", "event", "at")
    )
    assert "2026-03-01T12:00:00.000000000Z" == said["moment"]
    assert [("top", 4.5)] == [(level["name"], level["elevation"]) for level in said["levels"]]


def test_the_same_doors_are_the_same_text() -> None:
    """Whatever order they come in; one feature a line, ids ascending."""
    turned = DoorMap(dict(reversed(DOORS.doors.items())), DOORS.levels, 9, NOON_NS)

    text = dump_geojson(DOORS, {})[0]

    assert text == dump_geojson(turned, {})[0]
    assert [3, 7] == [json.loads(line.rstrip(","))["id"] for line in text.splitlines()[1:3]]


def test_a_map_without_doors_is_an_empty_collection() -> None:
    """And valid."""
    found = dumped(DoorMap({}, {}))

    assert ("FeatureCollection", []) == (found["type"], found["features"])
