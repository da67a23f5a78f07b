"""What `scan-report --json` prints."""

from __future__ import annotations

from math import isfinite
from typing import Any

from semmap_log.analysis.scans.door_figures import DoorFigures
from semmap_log.analysis.scans.scan_report import ScanReport


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
