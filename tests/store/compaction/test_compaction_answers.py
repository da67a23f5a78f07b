"""Whatever is appended, compacted and merged, in whatever order: every answer stays the same."""

from __future__ import annotations

import math
import random
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.core.model.events import DoorObserved, FloorMap, LevelAdded, Retracted, RobotPose
from semmap_log.errors import CommandError
from semmap_log.log.door_log.door_log_writer import DoorLogWriter
from semmap_log.store.compaction import compact, merge
from semmap_log.store.writing import segment_chain
from tests.conftest import SteadyClock
from tests.store.logs import answers

SEEDS = range(6)


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    """Segments of a few KiB of records, chunks of a few hundred bytes, merged up to 20 KiB."""
    monkeypatch.setattr(segment_chain, "ROLL_BYTES", 24_000)
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 7)
    monkeypatch.setattr(segment_chain, "CONTINUE_BELOW_BYTES", 20_000)
    monkeypatch.setattr(merge, "CHUNK_BYTES", 900)
    monkeypatch.setattr(merge, "READ_BYTES", 500)
    monkeypatch.setattr(merge, "MERGE_BYTES", 20_000)


class Session:
    """Appends what a robot might, drawn at random."""

    def __init__(self, log: DoorLogWriter, clock: SteadyClock, rng: random.Random) -> None:
        self.log = log
        self.clock = clock
        self.rng = rng
        known = log.replay()
        self.doors, self.levels = list(known.doors), set(known.levels)

    def do_something(self) -> None:
        more = [*5 * [self.see], self.change, self.name, self.plan, self.take_back, self.drive]
        choices = [self.add, *more] if self.doors else [self.add]
        self.rng.choice(choices)()

    def door(self) -> sl.DoorId:
        return self.rng.choice(self.doors)

    def add(self) -> None:
        note = {"actor": "survey"} if self.rng.random() < 0.5 else {}
        door = self.log.add_door(level=0, x=self.rng.random(), y=1.0, theta=0.0, width=0.9, **note)
        self.doors.append(door)

    def see(self) -> None:
        # Some sightings arrive late: what happened then is known only now.
        late = int(self.rng.random() * 10**10) if self.rng.random() < 0.3 else 0
        at = self.clock.now_ns - late
        for _ in range(self.rng.choice([1, 1, 1, 20])):
            self.log.observe(self.door(), self.rng.choice(["open", "closed"]), accuracy=0.9, at=at)

    def change(self) -> None:
        self.log.update_door(self.door(), state="open", reason="by hand")

    def name(self) -> None:
        self.log.annotate(self.door(), "name", f"door {self.rng.random()}")

    def plan(self) -> None:
        level = self.rng.randrange(3)
        if level not in self.levels:
            self.levels.add(level)
            self.log.append([LevelAdded(level=level, name=str(level), elevation=0.0)])
        cells = np.full((9, 9), self.rng.randrange(100), np.int8)
        self.log.append(
            [FloorMap(level=level, resolution=0.5, origin_x=0.0, origin_y=0.0, cells=cells)]
        )

    def take_back(self) -> None:
        number = max(0, self.log.replay().event - self.rng.randrange(5))
        if isinstance(self.log.event(number).event, DoorObserved):
            with suppress(CommandError):  # it is taken back already
                self.log.append([Retracted(first_event=number, last_event=number)])

    def drive(self) -> None:
        poses = (RobotPose(level=0, x=i, y=math.sin(i), theta=0.0) for i in range(40))
        self.log.append(poses)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.usefixtures("tiny")
def test_every_answer_stays_the_same(tmp_path: Path, seed: int) -> None:
    """Random sessions, with compactions of every kind between them."""
    rng, clock = random.Random(seed), SteadyClock()
    log = tmp_path / "log"
    sl.create(log, tz="UTC", clock=clock, entropy=rng.randbytes).close()
    compactions = 0

    for _ in range(4):
        with sl.append(log, clock=clock, entropy=rng.randbytes, compact=False) as opened:
            session = Session(opened, clock, rng)
            for _ in range(rng.choice([0, 1, 8, 20])):
                session.do_something()
        before = answers(log, moments=3)
        for _ in range(rng.choice([0, 1, 2])):
            done = compact(log, merge=rng.random() < 0.6)
            compactions += bool(done.steps)
            assert before == answers(log, moments=3), f"seed {seed}"

    assert compactions > 0
    compact(log)
    assert () == compact(log).steps
    assert before == answers(log, moments=3), f"seed {seed}"
