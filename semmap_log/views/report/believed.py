"""How likely each door is open when the page ends, and over its typical week."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from semmap_log.beliefs.belief_query import ask
from semmap_log.beliefs.door_beliefs import LATER, belief, default_estimator
from semmap_log.beliefs.typical_week import TypicalWeek, typical_week
from semmap_log.domain.doors import DoorId
from semmap_log.views.belief_words import why_unknown
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.zone_times import first_ms

UNKNOWN = -1
"""Stands for an hour that nobody has seen."""


def beliefs_of(excerpt: Excerpt, tz: str, doors: Collection[DoorId]) -> dict[DoorId, Any]:
    """Return, for the doors in the map when the page ends, what can be said of them.

    `p` is [P(open), low, high] (90 % interval), or null; then `why` says why. `week` has P(open)
    in percent for 168 hours from Monday's first on, or null where too little is known at all.
    """
    now = ask(excerpt.log, at=excerpt.last_ns(), estimator=default_estimator(), tz=tz, doors=None)
    now.prepare()
    habits = now.by(LATER)
    said: dict[DoorId, Any] = {}
    for door in now.doors:
        if door.door_id not in doors:
            continue
        known = belief(now, door)
        numbers = [round(value, 4) for value in (known.p_open, known.low, known.high)]
        said[door.door_id] = {
            "p": numbers if known.is_known else None,
            "why": "" if known.is_known else why_unknown(known.evidence),
            "knownAt": first_ms(known.known_ns),
            "week": _percent(typical_week(habits, door)),
        }
    return said


def _percent(week: TypicalWeek) -> list[int] | None:
    if not week.is_known:
        return None
    percent = np.rint(100 * week.hours.p_open).astype(np.int64)
    cells: list[int] = np.where(week.hours.is_known, percent, UNKNOWN).ravel().tolist()
    return cells
