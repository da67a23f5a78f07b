"""The JSON of `patrol-plan` and `costmap`: a planned patrol, and what was drawn of a costmap."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from semmap_log.analysis.costmaps import Costmap
from semmap_log.analysis.planning.followed_round import FollowedRound, RoundStep
from semmap_log.analysis.planning.patrol_plan import NotVisited, PatrolPlan, PlannedStop
from semmap_log.analysis.probabilities.forecast import INTERVAL
from semmap_log.analysis.rooms.door_ways import Place
from semmap_log.core.model.doors import Door
from semmap_log.core.model.moments import SECOND_NS, format_utc
from semmap_log.interop.formats.json.beliefs_json import ROUNDED
from semmap_log.interop.formats.json.door_json import door_map_to_json
from semmap_log.log import Scope


def plan_to_json(plan: PatrolPlan) -> dict[str, Any]:
    """Return the plan; where `is_known` is false, P is only a stand-in."""
    options = plan.options
    return {
        "start": format_utc(plan.start_ns),
        "known": format_utc(plan.known_ns),
        "tz": plan.tz,
        "estimator": plan.estimator,
        "interval": INTERVAL,
        "from": None if plan.start is None else place_to_json(plan.start),
        "speed_m_s": options.speed_m_s,
        "budget_s": options.budget_s,
        "enter_s": options.enter_s,
        "wait_at_shut_s": options.wait_s,
        "asks": options.asks,
        "skip_below": options.skip.below,
        "mean_time_to_visit_s": _or_none(plan.mean_visit_s),
        "expected_visits": round(plan.visits, ROUNDED),
        "stops": [_stop(number, stop, plan) for number, stop in enumerate(plan.stops, start=1)],
        "left_out": [_omitted(each) for each in plan.left_out],
        "notes": list(plan.notes),
    }


def step_to_json(step: RoundStep, round_: FollowedRound, plan: PatrolPlan) -> dict[str, Any]:
    """Return what an event of a round led to; once that is over, what became of it."""
    over = {
        "visited": [target.name for target in step.visited],
        "not_visited": [target.name for target in round_.not_visited],
    }
    number = len(step.visited) + 1
    return {
        "event": step.event,
        "happened": format_utc(step.at_ns),
        "because": step.because,
        "next": None if step.stop is None else _stop(number, step.stop, plan),
        "stops_left": step.left,
        **(over if step.stop is None else {}),
    }


def place_to_json(place: Place) -> dict[str, Any]:
    """Return a place."""
    return {"level": place.level, "x": round(place.x, 3), "y": round(place.y, 3)}


def _stop(number: int, stop: PlannedStop, plan: PatrolPlan) -> dict[str, Any]:
    return {
        "stop": number,
        "target": stop.target.name,
        "room_id": stop.target.room,
        "door_id": stop.door.door_id,
        "door": stop.door.name,
        "place": place_to_json(stop.place),
        "arrives": format_utc(stop.arrives_ns),
        "arrives_s": round((stop.arrives_ns - plan.start_ns) / SECOND_NS, 1),
        "p": round(stop.p_passes, ROUNDED),
        "low": round(stop.low, ROUNDED),
        "high": round(stop.high, ROUNDED),
        "is_known": stop.is_known,
        "wait_s": None if stop.wait_s is None else round(stop.wait_s, 1),
        "other_doors": [door.door_id for door in stop.others],
        "why": stop.why,
    }


def _omitted(each: NotVisited) -> dict[str, Any]:
    return {"target": each.name, "reason": each.reason, "why": each.said}


def _or_none(number: float) -> float | None:
    return round(number, 1) if math.isfinite(number) else None


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
