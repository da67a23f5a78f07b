"""The JSON of `evaluate`, `calibrate`, `rooms` and `rebase`.

Every answer with beliefs also lists the sensors that are not as accurate as declared.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from semmap_log.analysis.beliefs.evaluation import Evaluation
from semmap_log.analysis.beliefs.protocol import Protocol
from semmap_log.analysis.beliefs.sensor_calibration import Calibration, DoorCalibration, SensorHits
from semmap_log.analysis.probabilities.scores import Scores
from semmap_log.analysis.probabilities.sensors.sensor_doubts import SensorDoubt
from semmap_log.analysis.probabilities.sensors.sensor_shares import Seen
from semmap_log.analysis.rooms.level_rooms import RoomPlan
from semmap_log.analysis.rooms.room_graph import Doorway, Room
from semmap_log.core.folds.rebasing import MapFit, MovedDoor, RebasePlan
from semmap_log.core.model.doors import Door, DoorId
from semmap_log.core.model.moments import SECOND_NS
from semmap_log.interop.formats.json.door_json import door_map_to_json


def evaluation_to_json(
    evaluation: Evaluation, *, names: Mapping[DoorId, str] | None = None
) -> dict[str, Any]:
    """Return an evaluation: the mean over the doors, each door, and what was left out.

    Args:
        evaluation: What came of it.
        names: What the doors are called.
    """
    named = names or {}
    return {
        **_protocol(evaluation.protocol),
        "against": "truth" if evaluation.is_truth else "next_reading",
        "mean": {name: scores_to_json(found) for name, found in evaluation.mean.items()},
        "reliability": {
            name: [
                {"p": p, "frequency": frequency, "count": count}
                for p, frequency, count in found.rows()
            ]
            for name, found in evaluation.reliability.items()
        },
        "doors": [
            {
                "door_id": door.door_id,
                "name": named.get(door.door_id),
                "training": door.training,
                "tests": door.tests,
                "scores": {name: scores_to_json(found) for name, found in door.scores.items()},
            }
            for door in evaluation.doors
        ],
        "left_out": [
            {"door_id": door_id, "name": named.get(door_id), "reason": reason}
            for door_id, reason in evaluation.left_out.items()
        ],
        "sensor_doubts": doubts_to_json(evaluation.sensor_doubts),
    }


def scores_to_json(scores: Scores) -> dict[str, float | None]:
    """Return the four figures; null where there was no forecast."""
    return {
        "brier": scores.brier,
        "log_loss": scores.log_loss,
        "ece": scores.ece,
        "bias": scores.bias,
    }


def calibration_to_json(
    calibration: Calibration, *, names: Mapping[DoorId, str] | None = None
) -> dict[str, Any]:
    """Return how often a sensor read right: all doors together, and each.

    Args:
        calibration: What was found.
        names: What the doors are called.
    """
    named = names or {}
    return {
        **_accuracies(calibration.together),
        "doors": [
            {"door_id": door_id, "name": named.get(door_id), **_accuracies(door)}
            for door_id, door in calibration.doors.items()
        ],
        "unseen": list(calibration.unseen),
    }


def _accuracies(found: DoorCalibration) -> dict[str, Any]:
    return {
        "accuracy_open": _hits(found.when_open),
        "accuracy_closed": _hits(found.when_closed),
    }


def _hits(hits: SensorHits) -> dict[str, Any]:
    low, high = hits.interval
    return {
        "accuracy": hits.accuracy,
        "declare": hits.declared,
        "low": low,
        "high": high,
        "visits": hits.visits,
        "sightings": hits.sightings,
    }


def _protocol(protocol: Protocol) -> dict[str, Any]:
    patrol = protocol.patrol
    return {
        "split": protocol.split,
        "prequential": protocol.prequential,
        "horizon_s": None if protocol.horizon_ns is None else protocol.horizon_ns / SECOND_NS,
        "patrol": patrol
        and {
            "interval_s": patrol.interval_ns / SECOND_NS,
            "accuracy": patrol.accuracy,
            "seed": patrol.seed,
        },
        "step_s": protocol.step_s,
    }


def rooms_to_json(plan: RoomPlan, *, level: int | None = None) -> dict[str, Any]:
    """Return rooms, doorways and lifts, ids ascending; room 0 is the outside.

    Args:
        plan: Of a moment.
        level: Only the rooms and doorways of that one; None: of all.
    """
    graph = plan.graph
    said = door_map_to_json(plan.door_map)
    return {
        "event": said["event"],
        "at": said["at"],
        "known_at": said["known_at"],
        "levels": said["levels"],
        "levels_without_plan": list(graph.levels_without_plan),
        "rooms": [
            room_to_json(plan, room) for room in graph.rooms.values() if level in (None, room.level)
        ],
        "doorways": [
            _doorway(plan, each) for each in graph.doorways.values() if level in (None, each.level)
        ],
        "lifts": [{"name": lift.name, "doors": list(lift.doors)} for lift in graph.lifts],
    }


def room_to_json(plan: RoomPlan, room: Room) -> dict[str, Any]:
    """Return a room, the doors that lead into it and the rooms that they lead to."""
    return {
        "room_id": room.room_id,
        "level": room.level,
        "level_name": plan.door_map.level_name(room.level),
        "name": room.name,
        "area_m2": round(room.area_m2, 3),
        "x": room.x,
        "y": room.y,
        "doors": list(plan.graph.doors_of(room.room_id)),
        "leads_to": list(plan.graph.neighbours(room.room_id)),
    }


def _doorway(plan: RoomPlan, doorway: Doorway) -> dict[str, Any]:
    lift = plan.graph.lift_of(doorway.door_id)
    return {
        "door_id": doorway.door_id,
        "name": plan.door_map[doorway.door_id].name,
        "level": doorway.level,
        "left": doorway.left,
        "right": doorway.right,
        "joins_two": doorway.joins_two,
        "is_loop": doorway.is_loop,
        "in_wall": doorway.in_wall,
        "lift": lift.name if lift else None,
    }


def rebase_to_json(
    plan: RebasePlan, fit: MapFit | None, strangers: tuple[str, ...]
) -> dict[str, Any]:
    """Return the plan, and how well the pairs fit where there were any; metres and radians."""
    height, width = plan.floor.cells.shape
    return {
        "level": plan.level,
        "floor_map": {"width": width, "height": height, "resolution": plan.floor.resolution},
        "by": dict(zip(("dx", "dy", "theta"), plan.by.as_list(), strict=True)),
        "fit": None if fit is None else _fit(fit),
        "doors": [_door(door) for door in plan.doors],
        "unplaced": list(plan.unplaced),
        "elsewhere": list(plan.elsewhere),
        "placed_later": list(plan.placed_later),
        "not_in_log": list(strangers),
    }


def _fit(fit: MapFit) -> dict[str, Any]:
    pairs = zip(fit.pairs, fit.residuals_m, strict=True)
    return {
        "pairs": [{"name": pair.name, "residual_m": residual} for pair, residual in pairs],
        "worst_m": fit.worst_m,
        "misfits": list(fit.misfits),
        "worst_without_misfits_m": _number(fit.without_misfits_m),
        "hints": list(fit.hints),
    }


def _door(door: MovedDoor) -> dict[str, Any]:
    return {
        "door_id": door.after.door_id,
        "name": door.after.name,
        "before": _pose(door.before),
        "after": _pose(door.after),
        "measured": door.is_measured,
        "off_m": _number(door.off_m),
        "on_map": door.is_on_map,
    }


def _pose(door: Door) -> dict[str, Any] | None:
    if not door.is_placed:
        return None
    return {name: getattr(door, name) for name in ("x", "y", "theta", "width")}


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value


ROUNDED = 4


def doubts_to_json(doubts: Sequence[SensorDoubt]) -> list[dict[str, Any]]:
    """Return what was declared of each, what was seen, and how far P(open) may be off."""
    return [
        {
            "source": doubt.sensor.source or None,
            "accuracy_open": _seen(doubt.sensor.accuracy_open, doubt.when_open),
            "accuracy_closed": _seen(doubt.sensor.accuracy_closed, doubt.when_closed),
            "readings": doubt.readings,
            "doors": doubt.doors,
            "p_open_off": round(doubt.p_open_off, ROUNDED),
            "too_sure": round(doubt.too_sure, ROUNDED),
            "door_id": doubt.door_id,
            "message": str(doubt),
        }
        for doubt in doubts
    ]


def _seen(declared: float, seen: Seen) -> dict[str, Any]:
    told = bool(seen.how)
    return {
        "declared": declared,
        "seen": round(seen.accuracy, ROUNDED) if told else None,
        "low": round(seen.low, ROUNDED) if told else None,
        "high": round(seen.high, ROUNDED) if told else None,
        "by": seen.how or None,
    }
