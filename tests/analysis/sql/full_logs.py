"""Logs in which everything happens that a query can meet."""

from __future__ import annotations

import random
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import (
    DoorAnnotated,
    DoorObserved,
    DoorRequested,
    LevelAdded,
    RobotPose,
)
from semmap_log.errors import SemmapError
from semmap_log.store.writing import segment_chain
from tests.conftest import SteadyClock

HOUR_NS = 3600 * 10**9
COMMITS = 160


def full_log(path: Path, seed: int, commits: int = COMMITS) -> Path:
    """Write a log of several segments, the last one live, times to the nanosecond.

    Doors on two levels come, go, move and change their names; events come late, or from a clock
    that is ahead; some are taken back.
    """
    dice, clock, writing = random.Random(seed), SteadyClock(), path.parent / "writing" / path.name
    writing.parent.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_chain, "ROLL_COMMITS", 30)
        with sl.create(writing, tz="Europe/Vienna", clock=clock, durability="none",
                       compact=False) as log:  # fmt: skip
            for level in (0, 1):
                log.append([LevelAdded(level=level, name=f"L{level}")])
            for number in range(commits):
                clock.now_ns += dice.randrange(HOUR_NS)
                with suppress(SemmapError):  # of a door that is gone, or not there yet
                    _one_commit(dice, log, clock.now_ns, number)
            log.sync()
            shutil.copytree(writing, path)  # as it is while it is written: with a live end
    return path


def _one_commit(dice: random.Random, log: sl.DoorLogWriter, now_ns: int, number: int) -> None:
    at = now_ns - dice.choice([0, 0, 0, HOUR_NS, dice.randrange(40 * HOUR_NS), -HOUR_NS])
    ids = sorted(log.state.used_door_ids)
    door = DoorId(dice.choice(ids)) if ids else DoorId(1)
    about: dict[str, Any] = {
        "at": at, "actor": dice.choice(["", "ann", "b\u00f6b"]), "source": dice.choice(["", "cam"]),
        "reason": dice.choice(["", f"no. {dice.randrange(4)}"]),
    }  # fmt: skip
    note = sl.Note(actor="ann")
    match dice.choice(["seen"] * 6 + ["add"] * 2 + list(KINDS)):
        case "seen":
            state = dice.choice(["open", "closed", "unknown", "moving"])
            log.observe(door, state, accuracy=dice.choice([0.75, 1.0]), **about)
        case "add":
            log.add_door(x=float(number), y=0.5, theta=0.0, width=0.9, level=dice.choice([0, 1]),
                         name=f"n{number % 7}", **about)  # fmt: skip
        case "unplaced":
            log.add_door(name=f"u{number}", prob_open=0.25, **about)
        case "set":
            log.update_door(door, state="open", prob_open=dice.random(), **about)
        case "moved":
            log.update_door(door, x=1.5, y=2.0, theta=0.1, width=0.8, level=1, **about)
        case "named":
            log.append([DoorAnnotated(door_id=door, key="name", value=dice.choice(["", "a", "b"]),
                                      happened_ns=at)], note=note)  # fmt: skip
        case "said":
            log.annotate(door, "rooms", f"{number}, hall", **about)
        case "gone":
            log.remove_door(door, **about)
        case "passed":
            log.passed(door, passed=dice.choice([True, False]), **about)
        case "many":
            log.append(
                [DoorObserved(door_id=door, state=sl.DoorState.OPEN, happened_ns=at, opening=0.5),
                 DoorRequested(door_id=door, state=sl.DoorState.CLOSED, happened_ns=at + 7),
                 RobotPose(level=0, x=1.0, y=float(number), theta=0.0, happened_ns=at)],
                note=note,
            )  # fmt: skip
        case "taken back":
            last = log.state.event
            first = dice.randint(max(0, last - 9), max(0, last))
            log.retract(first, min(last, first + dice.randrange(3)))
        case "round":
            log.start_patrol(**about)
            if dice.random() < 0.7:
                log.finish_patrol(at=max(at, now_ns))


KINDS = ("unplaced", "set", "moved", "named", "said", "gone", "passed", "many", "taken back",
         "round")  # fmt: skip
