"""Logs of random events, in random commits, by clocks that jump: what a copy must not change."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import NAN, DoorState
from semmap_log.core.model.events import (
    Changed,
    ClassDefined,
    DoorAdded,
    DoorAnnotated,
    DoorEvent,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    DoorUpdated,
    Event,
    FloorMap,
    HistoryTrimmed,
    LevelAdded,
    LogExported,
    MomentPinned,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    RobotPose,
    SightingsThinned,
)
from semmap_log.errors import CommandError, InvalidEventError
from semmap_log.store.writing import segment_chain
from tests.conftest import SteadyClock

LATER_NS = 2_000_000_000 * 10**9
"""2033: when the copies are made."""


class JumpingClock(SteadyClock):
    """Stands still, jumps ahead and goes back."""

    def __init__(self, draw: random.Random) -> None:
        super().__init__()
        self.draw = draw

    def wall_ns(self) -> int:
        """Return a time near the last."""
        self.now_ns += self.draw.choice([0, 0, 10**9, 10**9, 3600 * 10**9, -(10**9), -(10**12)])
        return self.now_ns


def random_log(path: Path, seed: int, commits: int = 40, per_segment: int = 6) -> Path:
    """Write a log of about so many commits."""
    draw = random.Random(seed)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_chain, "ROLL_COMMITS", per_segment)
        with sl.create(path, tz="Europe/Vienna", clock=JumpingClock(draw), compact=False) as log:
            for _ in range(commits):
                count = draw.choice([1, 1, 1, 2, 3, 150])
                events = [random_event(draw, log, log.state.event + 1) for _ in range(count)]
                command = {"command_id": draw.randbytes(16), "content": draw.randbytes(16)}
                try:
                    log.append(events, note=random_note(draw), **draw.choice([{}, {}, command]))
                except (CommandError, InvalidEventError):
                    continue  # what the map forbids is not in any log
    return path


def random_note(draw: random.Random) -> Note:
    """Return one that often says nothing."""
    return Note(*(draw.choice(["", "", "", "eva", "Müller", "a\nb\u2028 {}"]) for _ in range(4)))


def random_event(draw: random.Random, log: sl.DoorLog, next_event: int) -> Event:
    """Return an event that the log most likely takes."""
    known = sorted(log.state.used_door_ids)  # type: ignore[attr-defined]
    kind = draw.choice([*KINDS_DRAWN, DoorAdded] if known else [DoorAdded])
    happened_ns = draw.choice(
        [None, 1_772_000_000 * 10**9, draw.randrange(LATER_NS), LATER_NS + draw.randrange(10**18)]
    )
    values = values_of(kind, draw, next_event)
    if issubclass(kind, DoorEvent):
        new = max(known, default=0) + draw.choice([1, 1, 5])
        values["door_id"] = new if kind is DoorAdded else draw.choice(known)
    return kind(happened_ns=happened_ns, **values)


KINDS_DRAWN = (
    *[DoorObserved] * 6, DoorUpdated, DoorUpdated, DoorRemoved, DoorRequested, DoorPassed,
    PatrolStarted, PatrolFinished, RobotPose, RobotPose, Retracted, DoorAnnotated, LevelAdded,
    FloorMap, LogExported, HistoryTrimmed, MomentPinned, SightingsThinned,
    ClassDefined,
)  # fmt: skip


def values_of(kind: type[Event], draw: random.Random, next_event: int) -> dict[str, object]:
    """Return random values of a kind's own fields."""

    def number() -> float:
        return draw.choice([0.0, -0.0, 1 / 3, draw.uniform(-1e9, 1e9), 5e-324])

    def share(low: float = 0) -> float:
        return draw.choice([1.0, low, draw.uniform(low, 1)])

    state = draw.choice(list(DoorState))
    pose = {"x": number(), "y": number(), "theta": number(), "width": abs(number())}
    probs = {"prob_open": draw.choice([NAN, share()]), "prob_closed": draw.choice([NAN, share()])}
    text = draw.choice(["", "name", "Küche\t'\"\\", "\u0001"])
    if kind is DoorAdded:
        return {"state": state, **draw.choice([pose, {}]), **probs}
    if kind is DoorUpdated:
        changed = draw.choice([31, 3, draw.randint(1, 31)])
        return {"changed": Changed(changed), "state": state, **pose, **probs}
    if kind is Retracted:
        first = draw.randrange(next_event)
        return {"first_event": first, "last_event": min(next_event - 1, first + draw.randrange(4))}
    if kind is FloorMap:
        cells = np.array([[draw.choice([-1, 0, 100])] * 3] * draw.randrange(4), np.int8)
        turn = draw.uniform(-3.14, 3.14)
        return {"resolution": 0.05, "origin_x": number(), "origin_y": number(),
                "origin_theta": turn, "cells": cells.reshape(-1, 3)}  # fmt: skip
    return {
        DoorRemoved: {},
        DoorObserved: {"state": state, "accuracy_open": share(0.5), "accuracy_closed": share(0.5),
                       "opening": draw.choice([NAN, share()])},
        DoorRequested: {"state": state},
        DoorPassed: {"passed": draw.random() < 0.5, "waited_s": draw.choice([NAN, share()])},
        PatrolStarted: {"patrol": draw.randrange(9)},
        PatrolFinished: {"patrol": draw.randrange(9)},
        RobotPose: {"x": number(), "y": number(), "theta": number(),
                    "sd_xy": draw.choice([NAN, share()]), "sd_theta": NAN},
        DoorAnnotated: {"key": draw.choice(["name", "kind", "class", "outline"]),
                        "value": draw.choice([text, "dock", "0,0 1,0 1,1"])},
        LevelAdded: {"level": draw.randrange(3), "name": text,
                     "elevation": draw.choice([NAN, 3.0])},
        LogExported: {"format": "yaml", "file_name": text, "at_ns": draw.randrange(LATER_NS)},
        HistoryTrimmed: {"next_event": draw.randrange(9), "events_gone": draw.randrange(9),
                         "notes_gone": 0, "horizon": 0, "reasons": "thinned", "rule": text,
                         "tombstones": draw.choice(["", "00ff"])},
        SightingsThinned: {"state": state, "count": draw.randrange(1, 9),
                           "accuracy_open": share(0.5), "accuracy_closed": share(0.5),
                           "first_ns": 5, "last_ns": draw.randrange(5, LATER_NS),
                           "first_event": draw.randrange(next_event)},
        MomentPinned: {"at_ns": draw.randrange(LATER_NS), "name": text,
                       "keyframe": draw.choice(["", "eA=="])},
        ClassDefined: {"class_name": draw.choice(["dock", "spill"]),
                       "geometry": draw.choice(["segment", "polygon", "point"]),
                       "states": "free,taken", "blocks": draw.choice(["", "taken"])},
    }[kind]  # fmt: skip
