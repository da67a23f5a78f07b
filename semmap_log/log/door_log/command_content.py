"""Whether events that are given again are those that are stored."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from semmap_log.core.messages import encode
from semmap_log.core.model.doors import is_given
from semmap_log.core.model.events import DoorAnnotated, Event, FloorMap

SAME_ANGLE = 1e-6
"""Radians: what going through a quaternion may change."""


def are_same(given: Sequence[Event], stored: Sequence[Event]) -> bool:
    """Tell whether events that are given are those that are stored.

    Salts do not count, nor when it happened, or on which level, where that was not given: the log
    said it.
    """
    return len(given) == len(stored) and all(map(_is_same, given, stored))


def _is_same(given: Event, stored: Event) -> bool:
    if type(given) is not type(stored):
        return False
    if given.happened_ns not in (None, stored.happened_ns):
        return False
    if not is_given(getattr(given, "level", 0)):  # the log said it
        given = replace(given, level=stored.level)  # type: ignore[call-arg,attr-defined]
    if isinstance(given, FloorMap) and isinstance(stored, FloorMap):
        return _is_same_map(given, stored)
    return encode(_unsalted(given), 0) == encode(_unsalted(stored), 0)


def _is_same_map(given: FloorMap, stored: FloorMap) -> bool:
    """Compare two floor plans; the angle of one that is stored went through a quaternion."""
    return (
        given.level == stored.level
        and np.float32(given.resolution) == np.float32(stored.resolution)
        and (given.origin_x, given.origin_y) == (stored.origin_x, stored.origin_y)
        and abs(math.remainder(given.origin_theta - stored.origin_theta, math.tau)) < SAME_ANGLE
        and np.array_equal(given.cells, stored.cells)
    )


def _unsalted(event: Event) -> Event:
    return replace(event, salt=b"") if isinstance(event, DoorAnnotated) else event
