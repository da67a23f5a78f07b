"""What a new map does to the doors, as JSON."""

from __future__ import annotations

import math
from typing import Any

from semmap_log.core.model.doors import Door
from semmap_log.log.door_log.map_fit import MapFit
from semmap_log.log.door_log.rebasing import MovedDoor, RebasePlan


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
