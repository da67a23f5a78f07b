"""Doors and rooms as GeoJSON (RFC 7946), for maps and tables.

A door is a line with what the map has of it; another object is a point or a polygon, by its class.
A room is a polygon along its cells, with its doors and where they lead.

RFC 7946 wants longitudes and latitudes (WGS 84). A door map knows where doors are in its own
frame only, so the coordinates are metres there, and the file says so: in the member `semmap_log`
for people, and in `crs`, as GeoJSON had it before that RFC. By that GDAL, and with it QGIS and
geopandas, see that it is a plane of its own; without it, or with null, they take WGS 84.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from typing import Any

from semmap_log.analysis.rooms.level_rooms import RoomPlan
from semmap_log.analysis.rooms.room_outlines import room_outline
from semmap_log.core.model.doors import Door, DoorMap, Geometry
from semmap_log.core.model.moments import format_utc
from semmap_log.interop.formats.json.door_json import door_map_to_json, door_to_json
from semmap_log.interop.formats.json.evaluation_json import room_to_json


def dump_room_geojson(plan: RoomPlan, about: Mapping[str, str], *, level: int | None = None) -> str:
    """Return the text; metres of the map frame, as in the doors' file.

    Args:
        plan: Of a moment; features have the keys of `rooms --json`, ids ascending.
        about: Facts about the log, such as its building.
        level: Only the rooms of that one; None: of all.
    """
    features = (
        {
            "type": "Feature",
            "id": room.room_id,
            "geometry": {
                "type": "Polygon",
                "coordinates": room_outline(plan.levels[room.level], room.room_id),
            },
            "properties": room_to_json(plan, room),
        }
        for room in plan.graph.rooms.values()
        if level in (None, room.level)
    )
    return feature_collection(collection_head(plan.door_map, about), features)


PLANE = (
    'LOCAL_CS["robot map frame",LOCAL_DATUM["robot map frame",32767],UNIT["metre",1],'
    'AXIS["x",OTHER],AXIS["y",OTHER]]'
)
"""A coordinate system of its own, as well-known text: which way x goes on earth, nobody knows."""

COORDINATES = (
    "metres, x and y in the frame `map` of the robot; not longitude and latitude as RFC 7946 "
    "has them, since the log does not know where on earth its map lies"
)


def dump_geojson(door_map: DoorMap, about: Mapping[str, str]) -> tuple[str, list[Door]]:
    """Return the text, and the doors in it that have no place: their geometry is null.

    Args:
        door_map: The doors; their features have the keys of `replay --json`, ids ascending.
        about: Facts about the log, such as its building.
    """
    head = collection_head(door_map, about)
    doors = sorted(door_map.doors.values(), key=lambda door: door.door_id)
    text = feature_collection(head, [_feature(door, door_map) for door in doors])
    return text, [door for door in doors if _geometry(door) is None]


def feature_collection(head: Mapping[str, Any], features: Iterable[Mapping[str, Any]]) -> str:
    """Return the text of a collection, a line a feature."""
    lines = ",\n".join(_text(feature) for feature in features)
    return f'{_text(head)[:-1]}, "features": [\n{lines}\n]}}\n'


def collection_head(door_map: DoorMap, about: Mapping[str, str]) -> dict[str, Any]:
    """Return what stands before the features: that these are metres of the map, and of when."""
    shown = door_map_to_json(door_map)
    del shown["doors"]
    return {
        "type": "FeatureCollection",
        "crs": {"type": "name", "properties": {"name": PLANE}},
        "semmap_log": {
            "coordinates": COORDINATES,
            "frame": "map",
            "unit": "m",
            **about,
            "moment": format_utc(door_map.moment_ns),
            **shown,
        },
    }


def _feature(door: Door, door_map: DoorMap) -> dict[str, Any]:
    return {
        "type": "Feature",
        "id": door.door_id,
        "geometry": _geometry(door),
        "properties": door_to_json(door, door_map),
    }


def _geometry(door: Door) -> dict[str, Any] | None:
    """Return the door's line, or what it is instead; None: no place, or one beyond all numbers."""
    points = [list(point) for point in door.extent]
    if not all(math.isfinite(number) for point in points for number in point):
        return None
    match door.object_class.geometry:
        case Geometry.POINT:
            return {"type": "Point", "coordinates": points[0]}
        case Geometry.POLYGON if door.outline:
            return {"type": "Polygon", "coordinates": [_ring(points)]}
        case _:
            return {"type": "LineString", "coordinates": points}


def _ring(corners: list[list[float]]) -> list[list[float]]:
    """Return corners counterclockwise, and the first once more, as RFC 7946 (3.1.6) has them."""
    following = [*corners[1:], corners[0]]
    area = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(corners, following, strict=True))
    ring = corners if area >= 0 else corners[::-1]
    return [*ring, ring[0]]


def _text(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
