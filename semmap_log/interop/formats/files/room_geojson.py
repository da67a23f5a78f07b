"""Rooms as GeoJSON: each a polygon along its cells, with its doors and where they lead."""

from __future__ import annotations

from collections.abc import Mapping

from semmap_log.analysis.rooms import RoomPlan
from semmap_log.analysis.rooms.room_outlines import room_outline
from semmap_log.interop.formats.files.geojson import collection_head, feature_collection
from semmap_log.interop.formats.json.rooms_json import room_to_json


def dump_room_geojson(plan: RoomPlan, about: Mapping[str, str], *, level: int | None = None) -> str:
    """Return the text; metres of the map frame, as in the doors' file.

    Args:
        plan: Of a moment; features have the keys of `rooms --json`, ids ascending.
        about: What is said of the log, such as its building.
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
