"""What a page holds, read as its own script reads it; and odd logs to make pages of."""

from __future__ import annotations

import json
import math
import random
import re
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

import semmap_log as sl
from semmap_log.core.model.doors import Door, DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, DoorObserved
from tests.conftest import SteadyClock
from tests.views.rerun.some_logs import SECOND, START, restless_log

MS = 10**6


def data_of(html: str) -> dict[str, Any]:
    """Return the data within a page."""
    (block,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', html)
    held: dict[str, Any] = json.loads(block)
    return held


def shown_at(data: dict[str, Any], t: int) -> dict[int, dict[str, Any]]:
    """Return the doors that the page shows so many milliseconds after its begin."""
    return {
        door["id"]: found
        for door in data["doors"]
        if door["added"] <= t and (door["removed"] is None or t < door["removed"])
        and (found := _door_at(door, t)) is not None
    }  # fmt: skip


def _door_at(door: dict[str, Any], t: int) -> dict[str, Any] | None:
    told = [(when, int(state)) for when, state in zip(accumulate(door["t"]), door["s"], strict=True)
            if when <= t]  # fmt: skip
    place = next((p for p in reversed(door["places"]) if p[0] <= t), [0, 0])
    given = next((g for g in reversed(door["probs"]) if g[0] <= t), [0, None, None])
    return {"state": DoorState(told[-1][1]).name, "seen": told[-1][0], "level": place[1],
            "line": place[2:], "probs": given[1:]}  # fmt: skip


def replayed_at(log: sl.DoorLog, data: dict[str, Any], t: int) -> dict[int, dict[str, Any]]:
    """Return what a replay of that moment says, in the page's words."""
    doors = log.replay(at=(data["begin"] + t) * MS).doors
    return {int(i): _as_shown(door, data["begin"]) for i, door in doors.items()}


def _as_shown(door: Door, begin_ms: int) -> dict[str, Any]:
    ends = [*door.start, *door.end]
    seen_ns = door.last_seen_ns
    assert seen_ns is not None
    return {
        "state": door.state.name,
        "seen": -(-seen_ns // MS) - begin_ms,
        "level": door.level,
        "line": [round(value, 3) for value in ends] if door.is_placed else [],
        "probs": [None if math.isnan(p) else round(p, 6)
                  for p in (door.prob_open, door.prob_closed)],
    }  # fmt: skip


def telling_moments(data: dict[str, Any], rng: random.Random, many: int) -> list[int]:
    """Return moments at, just before and between the changes."""
    at = [when for door in data["doors"] for when in accumulate(door["t"])]
    at += [place[0] for door in data["doors"] for place in door["places"]]
    at += [door["removed"] for door in data["doors"] if door["removed"] is not None]
    chosen = [rng.choice(at) + rng.choice([-1, 0, 1]) for _ in range(many)]
    chosen += [rng.randint(0, data["end"]) for _ in range(many)]
    return [min(max(t, 0), data["end"]) for t in (0, data["end"], *chosen)]


def retracted_log(path: Path, *, seed: int) -> sl.DoorLog:
    """A restless log some of whose events were taken back afterwards, the adding of one, too."""
    restless_log(path, seed=seed)
    rng = random.Random(seed)
    with sl.append(path) as log:
        for number in rng.sample(range(3, 250), 12):
            log.retract(number, actor="anna", reason="was not so")
    return sl.read(path)


def watched_log(path: Path) -> sl.DoorLog:
    """A door that is looked at each hour of three days, closed by then, and a note a day later."""
    clock = SteadyClock(START)
    with sl.create(path, tz="UTC", clock=clock) as log:
        door = log.add_door(x=0.0, y=0.0, theta=0.0, width=1.0, name="front", state="open")
        for day in range(3):
            for hour in range(10):
                at = START + (24 * day + hour) * 3600 * SECOND + SECOND // 3
                clock.now_ns = at + SECOND
                log.observe(door, "closed" if hour == 9 else "open", at=at)
        clock.now_ns = START + 3 * 24 * 3600 * SECOND
        log.annotate(door, "note", "a tail in which nothing happens")
    return sl.read(path)


def log_of(path: Path, *names: str, placed: bool = True) -> sl.DoorLog:
    """A door of each name, seen open, then closed an hour later."""
    clock = SteadyClock(START)
    with sl.create(path, tz="Europe/Vienna", clock=clock) as log:
        for i, name in enumerate(names):
            where = {"x": 2.0 * (i % 20), "y": 2.0 * (i // 20), "theta": 0.0, "width": 1.0}
            door = DoorId(i + 1)
            log.append([
                DoorAdded(door_id=door, **(where if placed else {})),
                DoorAnnotated(door_id=door, key="name", value=name),
            ], note=sl.Note(actor=name, reason=name))  # fmt: skip
            log.append([DoorObserved(door_id=door, state=DoorState.OPEN)])
        clock.now_ns = START + 3600 * SECOND
        if names:
            ids = np.arange(1, len(names) + 1)
            log.append([DoorObserved(door_id=DoorId(i), state=DoorState.CLOSED)
                        for i in ids.tolist()])  # fmt: skip
    return sl.read(path)
