"""What was drawn of a costmap, as the JSON that `costmap` prints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from semmap_log.analysis.costmaps import Costmap
from semmap_log.core.model.doors import Door
from semmap_log.core.model.moments import format_utc
from semmap_log.interop.formats.json.door_json import door_map_to_json
from semmap_log.log.replay.replay import Scope


def costmap_to_json(
    costmap: Costmap,
    drawn: Sequence[Door],
    left_out: Sequence[tuple[Door, str]],
    *,
    part: str,
    files: Sequence[Path],
    scope: Scope = Scope(),
) -> dict[str, Any]:
    """Return the files, the grid and its doors; a door's cost is what it draws (255: nothing).

    Args:
        costmap: Of a moment.
        drawn: The doors on its map.
        left_out: The others, with the reason.
        part: What of it was written: `master`, `door`, `keepout`.
        files: What was written.
        scope: Of which moment it is.
    """
    geometry, lines = costmap.geometry, costmap.lines
    doors = replace(costmap.doors, at_ns=scope.at_ns, known_at_ns=scope.known_at_ns)
    said = door_map_to_json(doors)
    return {
        "files": [str(path) for path in files],
        "layer": part,
        "event": said["event"],
        "at": said["at"],
        "known_at": said["known_at"],
        "moment": format_utc(doors.moment_ns) if doors.event >= 0 else None,
        "level": costmap.level,
        "level_name": doors.level_name(costmap.level),
        "has_floor": costmap.floor is not None,
        "by": costmap.options.by,
        "width": geometry.width,
        "height": geometry.height,
        "resolution": geometry.resolution,
        "origin_x": geometry.origin_x,
        "origin_y": geometry.origin_y,
        "doors": [
            {**_door(door), "state": door.state.name, "cost": lines[door.door_id].cost}
            for door in drawn
        ],
        "left_out": [{**_door(door), "why": why} for door, why in left_out],
    }


def _door(door: Door) -> dict[str, Any]:
    return {"door_id": door.door_id, "name": door.name}
