"""A planned trip as the JSON that `go` prints."""

from __future__ import annotations

import math
from typing import Any

from semmap_log.analysis.planning.door_trip import DoorTrip, TripStop
from semmap_log.analysis.probabilities.forecast import INTERVAL
from semmap_log.core.model.moments import SECOND_NS, format_utc
from semmap_log.interop.formats.json.beliefs_json import ROUNDED
from semmap_log.interop.formats.json.plan_json import place_to_json


def trip_to_json(trip: DoorTrip) -> dict[str, Any]:
    """Return the trip; times that nobody knows are null."""
    return {
        "from": place_to_json(trip.start),
        "to": place_to_json(trip.goal),
        "depart": format_utc(trip.depart_ns),
        "known": format_utc(trip.known_ns),
        "tz": trip.tz,
        "estimator": trip.estimator,
        "interval": INTERVAL,
        "expected_s": _or_null(trip.expected_s),
        "walk_s": _or_null(trip.walk_s),
        "doors": [_stop(stop, trip) for stop in trip.stops],
        "other_doors": [door.door_id for door in trip.others],
        "notes": list(trip.notes),
    }


def _stop(stop: TripStop, trip: DoorTrip) -> dict[str, Any]:
    choice = stop.if_shut
    return {
        "door_id": stop.door.door_id,
        "door": stop.door.name,
        "arrives": format_utc(stop.arrives_ns),
        "arrives_s": round((stop.arrives_ns - trip.depart_ns) / SECOND_NS, 1),
        "p_open": round(stop.p_open, ROUNDED),
        "low": round(stop.low, ROUNDED),
        "high": round(stop.high, ROUNDED),
        "is_known": stop.is_known,
        "p_answers": None if stop.p_answers is None else round(stop.p_answers, ROUNDED),
        "wait_s": None if stop.wait_s is None else round(stop.wait_s, 1),
        "if_shut": choice.best.name,
        "to_goal_s": {
            "WAIT": _or_null(choice.wait_s),
            "ASK": _or_null(choice.ask_s),
            "ROUND": _or_null(choice.round_s),
        },
    }


def _or_null(seconds: float) -> float | None:
    return round(seconds, 1) if math.isfinite(seconds) else None
