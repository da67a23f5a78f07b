"""Small fleets for tests, and answers worked out by other means."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

import semmap_log as sl
from tests.conftest import SteadyClock

HOUR_NS = 3600 * 10**9
START_NS = 1_772_409_600 * 10**9
"""2026-03-02T00:00Z."""


def make_log(folder: Path, seed: int, *, hours: int = 6, close: bool = True) -> Any:
    """Three doors, seen now and then; one sighting taken back, one told late, one door removed."""
    rng = np.random.default_rng(seed)
    clock = SteadyClock(START_NS)
    log = sl.create(folder, tz="UTC", robot=f"robot{seed}", building="clinic", clock=clock)
    doors = [
        log.add_door(x=float(n), y=0.0, theta=0.0, width=0.9, state="closed", name=f"d{n}")
        for n in range(3)
    ]
    for hour in range(hours):
        for minute in rng.permutation(60)[: rng.integers(4, 12)].tolist():
            state = rng.choice(["open", "closed", "unknown"], p=[0.5, 0.4, 0.1])
            at_ns = START_NS + hour * HOUR_NS + int(minute) * 60 * 10**9
            clock.now_ns = max(clock.now_ns, at_ns)
            log.observe(int(rng.choice(doors)), str(state), accuracy=0.9, at=at_ns)
    clock.now_ns = START_NS + hours * HOUR_NS
    log.retract(int(rng.integers(6, 12)))  # a sighting: adding a door is two events
    if seed % 2:
        log.remove_door(doors[2])
    if close:
        log.close()
        return None
    return log


def events_of(folder: Path) -> list[dict[str, Any]]:
    """The events that count, as `export` writes them: all that the oracle knows of ours."""
    out = folder.parent / f"{folder.name}.jsonl"
    run = [sys.executable, "-m", "semmap_log", "export", folder, out]
    subprocess.run(run, check=True, capture_output=True)
    lines = [json.loads(line) for line in out.read_text().splitlines()]
    out.unlink()
    return [each for each in lines if not each.get("retracted")]


def doors_then(events: list[dict[str, Any]]) -> dict[int, str]:
    """The state of each door that is there, by the last event that says one."""
    states: dict[int, str] = {}
    for event in sorted(events, key=lambda e: (min(e["happened"], e["recorded"]), e["event"])):
        if event["kind"] == "DoorRemoved":
            del states[event["door_id"]]
        elif event["kind"] in ("DoorAdded", "DoorObserved"):
            states[event["door_id"]] = event["state"]
    return states


def openings_then(events: list[dict[str, Any]]) -> dict[tuple[int, str], int]:
    """(door, hour) -> how often it is OPEN after it was known to be CLOSED."""
    known: dict[int, str] = {}
    found: dict[tuple[int, str], int] = {}
    for event in sorted(events, key=lambda e: (min(e["happened"], e["recorded"]), e["event"])):
        state = event.get("state")
        if event["kind"] not in ("DoorAdded", "DoorObserved") or state not in ("OPEN", "CLOSED"):
            continue
        door = event["door_id"]
        if (known.get(door), state) == ("CLOSED", "OPEN"):
            key = (door, min(event["happened"], event["recorded"])[:13])
            found[key] = found.get(key, 0) + 1
        known[door] = state
    return found
