"""Visits for tests, made by hand."""

from __future__ import annotations

from math import nan
from typing import Any

from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.doors import DoorId, DoorState

DOOR = DoorId(1)
START_NS = 1_767_000_000 * 10**9
S = 10**9


def some_visit(door_id: int = DOOR, at_s: float = 0.0, **other: Any) -> Visit:
    """Return a visit of 4 s that says OPEN, but for what is given."""
    first_ns = START_NS + round(at_s * S)
    told: dict[str, Any] = {
        "first_ns": first_ns, "last_ns": first_ns + 4 * S, "scans": 20, "state": DoorState.OPEN,
        "accuracy": 0.98, "opening": 0.9, "ajar": 0.02, "looks": 6.0, "through": 5.0,
        "stopped": 1.0, "behind_m": nan, "near": 5.0,
    }  # fmt: skip
    return Visit(door_id=DoorId(door_id), **{**told, **other})
