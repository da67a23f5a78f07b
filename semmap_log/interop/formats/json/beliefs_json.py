"""What is believed of doors as the JSON that `probabilities` and `best-time` print."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from semmap_log.analysis.beliefs import door_beliefs
from semmap_log.analysis.beliefs.best_times import BestTime, LikelyHours
from semmap_log.analysis.probabilities.evidence.coverage import DAY_NAMES, HOURS, spans_text
from semmap_log.analysis.probabilities.forecast import INTERVAL
from semmap_log.core.model.doors import Door
from semmap_log.core.model.moments import SECOND_NS, format_utc

if TYPE_CHECKING:
    from semmap_log.analysis.probabilities.sensors.sensor_doubts import SensorDoubt

ROUNDED = 6
"""Digits of probabilities."""


def beliefs_to_json(
    beliefs: Sequence[door_beliefs.DoorBelief], *, tz: str, known_at_ns: int | None = None
) -> dict[str, Any]:
    """Return P(open) of doors at one moment; where `is_known` is false, it is a guess."""
    first = beliefs[0] if beliefs else None
    return {
        "at": format_utc(first.known_ns) if first else None,
        "known_at": None if known_at_ns is None else format_utc(known_at_ns),
        "time": format_utc(first.time_ns) if first else None,
        "tz": tz,
        "estimator": first.estimator if first else None,
        "interval": INTERVAL,
        "doors": [belief_to_json(belief) for belief in beliefs],
        "sensor_doubts": _doubts(getattr(beliefs, "sensor_doubts", ())),
    }


def belief_to_json(belief: door_beliefs.DoorBelief) -> dict[str, Any]:
    """Return one door's."""
    return {
        **_door(belief.door, belief.level_name),
        "p_open": round(belief.p_open, ROUNDED),
        "p_closed": round(1.0 - round(belief.p_open, ROUNDED), ROUNDED),
        "low": round(belief.low, ROUNDED),
        "high": round(belief.high, ROUNDED),
        "is_known": belief.is_known,
        "evidence": _evidence(belief.evidence, belief.known_ns),
    }


def weeks_to_json(
    weeks: Sequence[door_beliefs.TypicalWeek],
    by: door_beliefs.By,
    *,
    hour: tuple[int, int] | None = None,
    tz: str,
    known_at_ns: int | None = None,
) -> dict[str, Any]:
    """Return P(open) of typical hours, days or weeks: lists of 24, of 7, or of 7 lists of 24.

    Days begin with Monday. `cell_is_known`: those that were ever seen; others are carried over.
    With `hour`, a day from Monday's 0 on and an hour, P(open) is of that one alone.
    """
    first = weeks[0] if weeks else None
    return {
        **({"by": by} if hour is None else {"when": f"{DAY_NAMES[hour[0]]} {hour[1]:02}:00"}),
        "at": format_utc(first.known_ns) if first else None,
        "known_at": None if known_at_ns is None else format_utc(known_at_ns),
        "tz": tz,
        "interval": INTERVAL,
        "doors": [
            _week(week, week.pattern(by) if hour is None else week.hours.taken(hour))
            for week in weeks
        ],
        "sensor_doubts": _doubts(getattr(weeks, "sensor_doubts", ())),
    }


def best_time_to_json(found: BestTime, *, known_at_ns: int | None = None) -> dict[str, Any]:
    """Return when a door is likeliest in a state."""
    now = found.now
    return {
        **_door(now.door, now.level_name),
        "state": found.state.upper(),
        "at": format_utc(now.known_ns),
        "known_at": None if known_at_ns is None else format_utc(known_at_ns),
        "tz": found.tz,
        "interval": INTERVAL,
        "is_known": found.is_known,
        "now": {
            "p_open": round(now.p_open, ROUNDED),
            "low": round(now.low, ROUNDED),
            "high": round(now.high, ROUNDED),
            "is_known": now.is_known,
        },
        "wait_s": None if found.wait_s is None else round(found.wait_s, 1),
        "wait_interval_s": (
            None if found.wait_interval_s is None else [round(s, 1) for s in found.wait_interval_s]
        ),
        "of_the_week": [_window(window) for window in found.of_the_week],
        "next": [_window(window) for window in found.next_ones],
        "evidence": _evidence(now.evidence, now.known_ns),
        "sensor_doubts": _doubts(found.sensor_doubts),
    }


def _doubts(doubts: Sequence[SensorDoubt]) -> list[dict[str, Any]]:
    if not doubts:
        return []
    from semmap_log.interop.formats.json.evaluation_json import doubts_to_json

    return doubts_to_json(doubts)


def _door(door: Door, level_name: str) -> dict[str, Any]:
    return {
        "door_id": door.door_id,
        "name": door.name,
        "level": door.level,
        "level_name": level_name,
    }


def _evidence(evidence: door_beliefs.EvidenceSummary, known_ns: int) -> dict[str, Any]:
    coverage, last_ns = evidence.coverage, evidence.counts.last_seen_ns
    return {
        "days": round(coverage.days, 2),
        "known_s": evidence.known_ns / SECOND_NS,
        "words": evidence.counts.words,
        "sightings": evidence.counts.sightings,
        "visits": evidence.counts.visits,
        "last_seen": None if last_ns is None else format_utc(last_ns),
        "age_s": None if last_ns is None else (known_ns - last_ns) / SECOND_NS,
        "hours_never_seen": coverage.hours_never_seen,
        "never_seen": spans_text(~coverage.is_seen),
    }


def _week(week: door_beliefs.TypicalWeek, pattern: door_beliefs.WeekPattern) -> dict[str, Any]:
    return {
        **_door(week.door, week.level_name),
        "is_known": week.is_known,
        "p_open": np.round(pattern.p_open, ROUNDED).tolist(),
        "low": np.round(pattern.low, ROUNDED).tolist(),
        "high": np.round(pattern.high, ROUNDED).tolist(),
        "cell_is_known": pattern.is_known.tolist(),
        "evidence": _evidence(week.evidence, week.known_ns),
    }


def _window(window: LikelyHours) -> dict[str, Any]:
    day, hour = divmod(window.first_hour, HOURS)
    return {
        "start": format_utc(window.start_ns),
        "end": format_utc(window.end_ns),
        "weekday": DAY_NAMES[day],
        "hour": hour,
        "hours": window.hours,
        "probability": round(window.probability, ROUNDED),
        "low": round(window.low, ROUNDED),
        "high": round(window.high, ROUNDED),
    }
