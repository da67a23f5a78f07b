"""The JSON of `go` and `scan-report`, and the kinds of JSON lines with their keys.

The kinds and keys are for help and documents, and are derived, never written by hand: kinds and
defaults from `events.KINDS`, keys from `event_json_reader`, descriptions from the `.msg` texts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite
from typing import Any

from semmap_log.analysis.planning.door_trip import DoorTrip, TripStop
from semmap_log.analysis.probabilities.forecast import INTERVAL
from semmap_log.analysis.scans.door_figures import DoorFigures, ScanReport
from semmap_log.core.messages import comments_of
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import KINDS, DoorAdded, DoorEvent, Event, FloorMap
from semmap_log.core.model.moments import SECOND_NS, format_utc
from semmap_log.interop.formats.json.beliefs_json import ROUNDED
from semmap_log.interop.formats.json.door_json import NOTE_KEYS
from semmap_log.interop.formats.json.event_json_reader import keys_of, required_keys
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


def scan_report_to_json(report: ScanReport) -> dict[str, Any]:
    """Return the figures and warnings of each door; null where nothing is known."""
    return {
        "doors": [_door(report, door) for door in report.doors],
        "not_met": [
            {"door_id": door_id, "name": report.labels.get(door_id)} for door_id in report.not_met
        ],
        "summary": list(report.summary),
        "warnings": list(report.oddities),
    }


def _door(report: ScanReport, door: DoorFigures) -> dict[str, Any]:
    return {
        "door_id": door.door_id,
        "name": report.labels.get(door.door_id),
        "visits": door.visits,
        "open": door.open,
        "closed": door.closed,
        "undecided": door.undecided,
        "driven_through": door.passed,
        "said_accuracy": _number(door.accuracy.value),
        "opening": _number(door.opening.value),
        "behind_m": _number(door.behind_m.value),
        "behind_visits": door.behind_m.count,
        "left_m": _number(door.left_m.value),
        "undecided_because": dict(sorted(door.reasons.items())),
        "warnings": [
            {"concern": warning.concern.value, "text": warning.text}
            for warning in report.warnings_of(door.door_id)
        ],
    }


def _number(value: float) -> float | None:
    return value if isfinite(value) else None


OF_EVERY_KIND = ("happened", *NOTE_KEYS, "command_id")

_WORDS = {
    "state": " ".join(DoorState.__members__),
    "accuracy": "both accuracies, where they are the same",
    "changed": "names of what is set; the other keys say it already",
    "at": "the moment whose state was saved: a time",
}
"""Of keys that are no field, or that a line writes in another way than the `.msg` text."""

_FLOOR_MAP_WORDS = {
    "resolution": "length of a cell [m]",
    "origin_x": "lower left corner of the first cell [m, frame map]",
    "width": "in cells",
    "height": "in cells",
    "cells_zlib_base64": "a byte a cell, row by row from the lowest y: 0 free .. 100 occupied, "
    "-1 unknown",
}
"""A floor plan is ROS's own message, which has no text of ours."""


@dataclass(frozen=True, slots=True)
class Key:
    """A key of a kind of line."""

    name: str
    is_optional: bool
    words: str
    """What it means, or its unit; empty where its name says all."""


def kinds_and_keys() -> Iterator[tuple[str, str, list[Key]]]:
    """Yield each kind, what it means, and its keys, besides those of every kind."""
    for kind in KINDS:
        meaning = (kind.__doc__ or "").splitlines()[0]
        yield kind.__name__, meaning, list(_keys(kind))


def help_text(width: int = 78) -> str:
    """Return kinds and keys as the end of a verb's help."""
    lines = [
        "  Kinds of a line, and their keys; in [ ] those that may be left out:",
    ]
    for kind, _, keys in kinds_and_keys():
        shown = [f"[{key.name}]" if key.is_optional else key.name for key in keys]
        lines += _wrapped(f"    {kind:<15}", shown, width)
    lines += _wrapped("    every kind:    ", [f"[{name}]" for name in OF_EVERY_KIND], width)
    lines += [
        f"  A state is one of {_WORDS['state']}. A time is",
        "  ISO-8601 text (without an offset: in the log's zone) or a number: seconds",
        "  since 1970, from 18 digits on nanoseconds. null: a number that is not known.",
    ]
    return "\n".join(lines) + "\n"


def document() -> str:
    """Return kinds and keys as tables in Markdown."""
    parts = []
    for kind, meaning, keys in kinds_and_keys():
        rows = (
            f"| `{_cell(key.name)}` | {'no' if key.is_optional else 'yes'} | {_cell(key.words)} |"
            for key in keys
        )
        table = "\n".join(["| key | needed | meaning |", "| --- | --- | --- |", *rows])
        parts.append(f"## {kind}\n{meaning}\n\n{table}\n")
    return "\n".join(parts)


def _keys(kind: type[Event]) -> Iterator[Key]:
    needed = {key for key, _ in required_keys(kind)}
    if kind is FloorMap:
        needed = {*keys_of(kind)} - {"origin_theta"}
    needed -= {"changed"}  # the other keys say it
    if kind is DoorAdded:
        needed -= {"door_id"}  # the next free one
    elif issubclass(kind, DoorEvent):
        yield Key("door_id|door", is_optional=False, words="its id; or its name, or level/name")
    words = _FLOOR_MAP_WORDS if kind is FloorMap else _json_words(kind)
    by_name = () if kind is DoorAdded else ("door_id", "door")
    for name in keys_of(kind):
        if name not in {*OF_EVERY_KIND, *by_name}:
            yield Key(name, name not in needed, words.get(name, ""))


def _json_words(kind: type[Event]) -> dict[str, str]:
    """Return what each key means."""
    words = comments_of(kind.__name__).items()
    return {name: text.replace("NaN:", "null:") for name, text in words} | _WORDS


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _wrapped(head: str, words: list[str], width: int) -> Iterator[str]:
    line = head
    for word in words:
        if len(line) + 1 + len(word) > width:
            yield line
            line = " " * len(head)
        line += f" {word}"
    yield line
