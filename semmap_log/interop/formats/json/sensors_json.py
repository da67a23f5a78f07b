"""Sensors that are not as accurate as declared, as the JSON of all that tells beliefs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from semmap_log.analysis.probabilities.sensors.sensor_doubts import SensorDoubt
from semmap_log.analysis.probabilities.sensors.sensor_shares import Seen

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
