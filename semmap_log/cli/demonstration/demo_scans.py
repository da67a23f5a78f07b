"""The demo's second half: a bag of laser scans in, doors out, held against the truth."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import semmap_log as sl
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorObserved, DoorPassed
from semmap_log.core.model.moments import SECOND_NS
from semmap_log.interop.importing.importing import ImportOptions, import_file
from semmap_log.interop.importing.scan_topics import ScanOptions

SCANS = "office_scans"
VISIT_S = 10.0
"""A robot looks at a door for about so long; the sighting is of the end of that."""


@dataclass(frozen=True, slots=True)
class SeenDoor:
    """What the scans said of a door, and how it really stood."""

    name: str
    happened_ns: int
    said: str
    """OPEN or CLOSED."""
    accuracy: float
    passed: bool
    """The robot drove through."""
    truth: str
    """OPEN, AJAR or CLOSED; several, in order: it moved during the last `VISIT_S`."""


@dataclass(frozen=True, slots=True)
class SeenByLaser:
    """What the demo made of the bag."""

    log: Path
    doors: Sequence[SeenDoor]


def see_by_laser(folder: Path, recordings: Path, *, tz: str) -> SeenByLaser:
    """Make a log of the shipped bag: its doors, then what its scans say of them.

    Args:
        folder: Where to.
        recordings: Where the bag, its doors and its truth are.
        tz: The building's zone.
    """
    log = folder / SCANS
    with sl.create(log, tz=tz, building="rmf_office") as writer:
        import_file(writer, recordings / f"{SCANS}.doors.jsonl")
        import_file(writer, recordings / f"{SCANS}.mcap", ImportOptions(scan=ScanOptions()))
    truth = json.loads((recordings / f"{SCANS}.truth.json").read_text(encoding="utf-8"))
    doors = {door["door_id"]: door for door in truth["doors"]}
    return SeenByLaser(log, _seen(sl.read(log), doors, truth["start_ns"]))


def _seen(log: sl.DoorLog, doors: dict[DoorId, Any], start_ns: int) -> list[SeenDoor]:
    found = []
    for entry in log.history():
        match entry.event:
            case DoorObserved() as event:
                said, accuracy, passed = event.state.name, event.accuracy_open, False
            case DoorPassed() as event:
                said, accuracy, passed = "OPEN", 1.0, True
            case _:
                continue
        door = doors[event.door_id]
        at_s = (entry.happened_ns - start_ns) / SECOND_NS
        truth = _truth(door["states"], at_s if passed else at_s - VISIT_S, at_s)
        found.append(SeenDoor(door["name"], entry.happened_ns, said, accuracy, passed, truth))
    return sorted(found, key=lambda seen: seen.happened_ns)


def _truth(rows: Sequence[dict[str, Any]], from_s: float, to_s: float) -> str:
    """Return how a door stood from one moment to another, in words."""
    from_s = max(from_s, 0.0)
    before = [row["state"] for row in rows if row["from_s"] <= from_s][-1:]
    later = [row["state"] for row in rows if from_s < row["from_s"] <= to_s]
    stood = [state for state in (*before, *later) if state != "MOVING"]
    return ", then ".join(stood) or "MOVING"
