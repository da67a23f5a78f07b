"""Goals as an action server hands them on."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any

from semmap_log.core.model.events import Changed
from semmap_log.live.ros.ros_node import Goal

DOOR = {"pos_x": 2.0, "pos_y": 1.5, "pos_theta": 0.0, "width": 0.9, "door_state": "CLOSED",
        "prob_open": 0.3, "prob_closed": 0.7}  # fmt: skip
"""A good door, as AddDoor takes it."""

FIELDS = {
    "change_pos": (Changed.POSE, {"pos_x": 5.0, "pos_y": 6.0, "pos_theta": 1.0}),
    "change_width": (Changed.WIDTH, {"width": 1.25}),
    "change_open": (Changed.STATE, {"door_state": "OPEN"}),
    "change_prob_open": (Changed.PROB_OPEN, {"prob_open": 0.5}),
    "change_prob_closed": (Changed.PROB_CLOSED, {"prob_closed": 0.25}),
}
"""Flags of UpdateDoor: what each sets, and values for it."""


def goal_of(
    action: str, raw_goal_id: str, feedback: Callable[[float], None] = lambda _: None, **values: Any
) -> Goal:
    goal_id = hashlib.sha256(raw_goal_id.encode()).digest()[:16]
    return Goal(action, goal_id, raw_goal_id, "/tester", values, feedback)
