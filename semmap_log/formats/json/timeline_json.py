"""A door's timeline as the JSON that `timeline --json` prints."""

from __future__ import annotations

from typing import Any

from semmap_log.domain.doors import DoorState
from semmap_log.domain.moments import SECOND_NS, format_utc
from semmap_log.folds.timeline import Interval, Timeline


def timeline_to_json(timeline: Timeline, *, name: str | None = None) -> dict[str, Any]:
    """Return the intervals, the earliest first, and how many seconds each state lasted in all.

    Args:
        timeline: A door's.
        name: What it is called.
    """
    return {
        "door_id": timeline.door_id,
        "name": name,
        "removed": timeline.removed,
        "intervals": [_interval(interval) for interval in timeline],
        "seconds": {
            state.name: timeline.total_ns(state) / SECOND_NS
            for state in DoorState
            if (timeline.state == state).any()
        },
    }


def _interval(interval: Interval) -> dict[str, Any]:
    return {
        "since": format_utc(interval.start_ns),
        "until": format_utc(interval.end_ns),
        "state": interval.state.name,
        "sightings": interval.sightings,
        "event": interval.event,
    }
