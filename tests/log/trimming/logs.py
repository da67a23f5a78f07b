"""Logs of several segments, and all that can be asked of their states."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path, PurePath
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.model.events import RobotPose
from semmap_log.log.trimming.redaction import Annotation, Notes, Redaction, Tracks
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain

SECOND_NS = 10**9
START_NS = 1_700_000_000 * SECOND_NS


class MinuteClock:
    """Begins in 2023, and goes on by itself."""

    boot_id = bytes(16)

    def __init__(self) -> None:
        self.now_ns = START_NS

    def wall_ns(self) -> int:
        self.now_ns += SECOND_NS
        return self.now_ns

    def monotonic_ns(self) -> int:
        return self.now_ns


def random_log(
    folder: Path, seed: int, patch: pytest.MonkeyPatch, commits: int = 400, roll: int = 90
) -> Path:
    """Return a log with sightings that repeat, late ones, poses, notes, texts, retractions.

    Args:
        folder: Where it shall lie.
        seed: Of all that is random.
        patch: For as long as it is written.
        commits: How many.
        roll: How many there are in a segment.
    """
    patch.setattr(segment_chain, "ROLL_COMMITS", roll)
    draw, clock, path = random.Random(seed), MinuteClock(), folder / "log"
    with sl.create(path, tz="UTC", clock=clock, compact=False) as log:
        doors = [
            log.add_door(x=float(i), y=1.0, theta=0.0, width=0.9, name=f"secret{i}", actor="anna")
            for i in range(3)
        ]
        states = dict.fromkeys(doors, "open")
        for _ in range(commits):
            clock.now_ns += draw.choice([60, 120, 300]) * SECOND_NS
            _one_commit(log, draw, states, clock.now_ns)
    return path


def _one_commit(
    log: sl.DoorLogWriter, draw: random.Random, states: dict[Any, str], now_ns: int
) -> None:
    door = draw.choice(list(states))
    if draw.random() < 0.08:
        states[door] = draw.choice(["open", "closed"])
    what = draw.random()
    if what < 0.05:
        log.append([RobotPose(x=draw.random(), y=2.0, theta=0.0)])
    elif what < 0.08:
        log.annotate(door, "name", f"secret{draw.random()}", actor=draw.choice(["anna", "bert"]))
    elif what < 0.1:
        seen = log.observe(door, "moving")
        log.retract(seen.commit.last_event, reason="secret reason")
    else:
        late = {"at": f"@{now_ns - draw.randrange(7200) * SECOND_NS}"} if what > 0.95 else {}
        log.observe(door, states[door], accuracy=0.9, actor=draw.choice(["anna", ""]), **late)


def moments(log: Path, seed: int, count: int = 60) -> list[dict[str, Any]]:
    """Return moments of every kind, by the keywords of `replay`."""
    reader, draw = sl.read(log), random.Random(seed)
    last = reader.last_event()
    commits = list(reader.commits())
    found: list[dict[str, Any]] = []
    for _ in range(count):
        at = f"@{draw.randrange(START_NS, commits[-1].closed_ns + 10**12)}"
        commit = draw.choice(commits)
        known = f"@{draw.choice([commit.recorded_ns, commit.closed_ns, commit.recorded_ns - 1])}"
        found += [{"at": at}, {"known_at": known}, {"at": at, "known_at": known}]
        found.append({"event": draw.randrange(last + 1)})
    return found


def until_ns(log: Path) -> int:
    """Return when the commit of event 110 was recorded."""
    return next(c.recorded_ns for c in LogReader(log).commits() if c.last_event >= 110)


def redaction(log: Path) -> Redaction:
    """Return a rule that redacts one person's notes, all tracks and the names of the doors."""
    reader = sl.read(log)
    parts = [Notes("anna"), Tracks(), *(Annotation(door, "name") for door in (1, 2, 3))]
    return Redaction(parts, reader.last_event() + 1, tuple(reader.pins().values()))


def answers(log: PurePath, asked: Sequence[dict[str, Any]]) -> list[Any]:
    """Return what each door's state and place was at each moment; the error's name if it is one."""
    return answers_of(sl.read(log), asked)


def answers_of(log: sl.DoorLog, asked: Sequence[dict[str, Any]]) -> list[Any]:
    """Return the same of a log that is open."""
    found = list[Any]()
    for moment in asked:
        try:
            doors = log.replay(**moment).doors
        except sl.SemmapError as error:
            found.append(type(error).__name__)
            continue
        found.append([(int(i), door.state, door.x, dict(door.annotations)) for i, door in
                      doors.items()])  # fmt: skip
    return found


def without_texts(found: Sequence[Any]) -> list[Any]:
    """Return answers without what is said of doors in words."""
    return [one if isinstance(one, str) else [row[:3] for row in one] for one in found]
