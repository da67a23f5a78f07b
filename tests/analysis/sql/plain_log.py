"""The oracle of the views: plain Python over a log's exported JSON lines, an event a dict.

It shares nothing with the product but the lines: fields are folded one write at a time.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from datetime import datetime
from pathlib import Path
from typing import Any

Event = dict[str, Any]
POSE = ("level", "x", "y", "theta")
FIELDS = (*POSE, "width", "state", "prob_open", "prob_closed")
Stamp = tuple[int, int]


def events_of(lines: Path) -> list[Event]:
    """Return the events of a file, with their times in nanoseconds and when they count."""
    found = []
    for line in lines.read_text(encoding="utf-8").splitlines():
        event = json.loads(line)
        event["happened_given"] = nanoseconds(event["happened"])
        event["recorded_ns"] = nanoseconds(event["recorded"])
        event["happened_ns"] = min(event["happened_given"], event["recorded_ns"])
        event["retracted"] = event.get("retracted", False)
        if "accuracy" in event:
            event |= {"accuracy_open": event["accuracy"], "accuracy_closed": event["accuracy"]}
        found.append(event)
    return found


def nanoseconds(text: str) -> int:
    """Return an ISO-8601 time in UTC."""
    whole, _, fraction = text.removesuffix("Z").partition(".")
    seconds = int(datetime.fromisoformat(f"{whole}+00:00").timestamp())
    return seconds * 10**9 + int(fraction.ljust(9, "0") or 0)


def stamp(event: Event) -> Stamp:
    """Return by what events are ordered."""
    return event["happened_ns"], event["event"]


def known_by(events: Iterable[Event], last: int) -> list[Event]:
    """Return the events up to a number, without those that these themselves take back."""
    there = [event for event in events if event["event"] <= last]
    hidden = {
        number
        for event in there
        if event["kind"] == "Retracted"
        for number in range(event["first_event"], event["last_event"] + 1)
    }
    return [e for e in there if e["event"] not in hidden or e["kind"] == "Retracted"]


def registers(events: Iterable[Event]) -> dict[int, dict[str, Any]]:
    """Return what each door's fields and texts hold: door -> field -> value, the latest write's."""
    found: dict[int, dict[str, Any]] = {}
    for event in sorted(events, key=stamp):
        if "door_id" in event:
            found.setdefault(event["door_id"], {}).update(writes(event))
    return found


def writes(event: Event) -> dict[str, Any]:
    """Return what an event sets of its door."""
    match event["kind"]:
        case "DoorAdded":
            return {name: event.get(name) for name in FIELDS}
        case "DoorUpdated":
            parts = [p for p in event["changed"] if p != "POSE"]
            names = [*(POSE if "POSE" in event["changed"] else ()), *(p.lower() for p in parts)]
            return {name: event.get(name) for name in names}
        case "DoorObserved":
            return {"state": event["state"]}
        case "DoorPassed":
            return {"state": "OPEN"} if event["passed"] else {}
        case "DoorAnnotated":
            return {f"text {event['key']}": event["value"]}
        case _:
            return {}


def lives(events: Iterable[Event]) -> dict[int, tuple[Stamp, int | None]]:
    """Return when each door was added, and the time of its removal, if it was."""
    added: dict[int, Stamp] = {}
    removed: dict[int, int] = {}
    for event in sorted(events, key=stamp):
        if event["kind"] == "DoorAdded":
            added.setdefault(event["door_id"], stamp(event))
        elif event["kind"] == "DoorRemoved" and event["door_id"] in added:
            removed.setdefault(event["door_id"], event["happened_ns"])
    return {door: (since, removed.get(door)) for door, since in added.items()}


def doors_of(events: list[Event]) -> dict[int, dict[str, Any]]:
    """Return the doors that are there after these events, which all count."""
    born = lives(events)
    there = {door for door, (_, gone) in born.items() if gone is None}
    mine = [e for e in events if e.get("door_id") in there and stamp(e) >= born[e["door_id"]][0]]
    found = {door: held for door, held in registers(mine).items() if door in there}
    for event in sorted(mine, key=stamp):
        if "state" in writes(event):
            found[event["door_id"]]["last_seen"] = event["happened_ns"]
    return found


def names_as_of(events: list[Event]) -> dict[int, str | None]:
    """Return for each event what its door was called then, by what is known now."""
    counting = [event for event in events if not event["retracted"]]
    born = lives(counting)
    said = [e for e in counting if e["kind"] == "DoorAnnotated" and e["key"] == "name"]
    found: dict[int, str | None] = {}
    for event in events:
        door = event.get("door_id")
        since = born[door][0] if door in born else (0, -1)
        names = [
            e
            for e in said
            if e["door_id"] == door and since < stamp(e) and stamp(e)[0] <= stamp(event)[0]
        ]
        latest = max(names, key=stamp, default=None)
        found[event["event"]] = (latest["value"] or None) if latest else None
    return found


def intervals_of(events: list[Event], end_ns: int) -> list[tuple[int, int, int, str]]:
    """Return (door, since, until, state), neighbours of one state joined."""
    found = []
    for door, (added, gone) in sorted(lives(events).items()):
        said = sorted(
            (e for e in events if e.get("door_id") == door and stamp(e) >= added), key=stamp
        )
        said = [e for e in said if gone is None or e["happened_ns"] < gone]
        at_time = {e["happened_ns"]: writes(e)["state"] for e in said if "state" in writes(e)}
        last = end_ns if gone is None else gone
        ends = [*list(at_time)[1:], last]
        mine: list[tuple[int, int, int, str]] = []
        for (since, state), until in zip(at_time.items(), ends, strict=True):
            if mine and mine[-1][3] == state:
                mine[-1] = (door, mine[-1][1], until, state)
            else:
                mine.append((door, since, until, state))
        found += mine
    return found


def changes_of(events: list[Event]) -> set[tuple[int, int, str, Any, Any]]:
    """Return (event, door, field, before, after) of what each changed as it was recorded."""
    found = set()
    for event in events:
        if "door_id" not in event:
            continue
        before, after = (
            registers(known_by(events, event["event"] - back)).get(event["door_id"], {})
            for back in (1, 0)
        )
        for field, value in after.items():
            if value != before.get(field):
                name = field.removeprefix("text ")
                found.add((event["event"], event["door_id"], name, before.get(field), value))
    return found
