"""Many threads that use one log as hard as they can: luck, where `interleaving` draws the order."""

from __future__ import annotations

import faulthandler
import json
import os
import random
import shutil
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import semmap_log as sl
from fault_injection.acknowledged import Said, Tell, digest, lost_and_invented
from fault_injection.asking import what_verify_says
from fault_injection.fault import Outcome, Plan
from fault_injection.forking import forked
from fault_injection.oracle_client import Oracle
from fault_injection.sample import small_segments
from fault_injection.subject import keep
from semmap_log.core.model.events import RobotPose
from semmap_log.errors import SemmapError
from semmap_log.log.door_log.door_log_writer import DoorLogWriter

THREADS = 8
EACH = 12
SHORT, LONG = 10, 60_000
LONGEST_S = 120
LEVELS = ("none", "event", "batch", "flush")


@dataclass(frozen=True)
class Storm:
    """One run of many threads."""

    turn: int
    level: str
    seed: int

    def __str__(self) -> str:
        return f"{self.turn}: {THREADS} threads at once, durability {self.level}, seed {self.seed}"


def try_storm(plan: Plan, storm: Storm, oracle: Oracle) -> Outcome:
    """Let threads use a log; compare what they were told with the bytes that are left."""
    folder = plan.folder / f"storm-{storm.seed}-{storm.level}"
    folder.mkdir()
    try:
        ended = forked(lambda tell: _Weather(storm, folder / "log", tell).run())
        said = Said.of(ended.lines)
        problems = list(said.problems)
        if ended.status:
            problems.append(f"it ended with {ended.status}: {ended.error}")
        promised = said.accepted if said.closed else said.durable
        found = oracle.ask(folder / "log")
        lost, invented, problem = lost_and_invented(said, found, promised)
        poses = sorted(e["x"] for e in found["events"] if e["kind"] == "RobotPose")
        problems += [problem] if problem else []
        if said.closed and poses != sorted(said.poses):
            problems.append(f"{len(said.poses)} poses were given, {len(poses)} are there")
        problems += what_verify_says(folder / "log", is_closed=said.closed)
        what = str(storm)
        kept = keep(folder, plan.keep, what) if problems or lost or invented else None
        return Outcome(what, len(said.accepted), lost, invented, "\n".join(problems), kept)
    finally:
        shutil.rmtree(folder)


class _Weather:
    """The threads of one run, in a process of their own."""

    def __init__(self, storm: Storm, path: Path, tell: Tell) -> None:
        self._storm = storm
        self._path = path
        self._tell = tell
        self._over = threading.Event()
        self._log: DoorLogWriter

    def run(self) -> None:
        """Write, read, poll and compact until all is written; then close."""
        faulthandler.dump_traceback_later(LONGEST_S, exit=True)
        dice = random.Random(self._storm.seed)
        roll = dice.choice((7, 25, 10_000))
        _slow_down(dice.choice((0.0, 0.0005, 0.003)))
        with small_segments(roll, chunk_bytes=dice.choice((400, 2**20))):
            self._log = sl.create(
                self._path, tz="UTC", durability=self._storm.level, batch_events=8, batch_s=0.003
            )
            self._log.add_door()
            writers = [
                self._thread(self._write, str(name), dice.random()) for name in range(THREADS)
            ]
            others = [self._thread(work) for work in (self._poll, self._refresh, self._follow)]
            for thread in writers:
                thread.join()
            self._over.set()
            for thread in others:
                thread.join()
            with suppress(SemmapError):
                self._noted(self._log.close)
                self._say("closed")

    def _thread(self, work: Callable[..., None], *arguments: Any) -> threading.Thread:
        def guarded() -> None:
            with suppress(Exception):
                self._noted(lambda: work(*arguments))

        thread = threading.Thread(target=guarded, daemon=True)
        thread.start()
        return thread

    def _write(self, name: str, seed: float) -> None:
        dice, waiting = random.Random(seed), list[str]()
        for number in range(EACH):
            key = f"{name}/{number}"
            text = f"{key} ".ljust(dice.choice((SHORT, LONG)), "x")
            self._say("tried", key)
            appended = self._log.annotate(1, key, text)
            self._say("accepted", key, appended.first_event, digest(text))
            waiting.append(key)
            if number % 3 == 2:
                appended.wait()
                self._durable([key])
            if dice.random() < 0.1:
                self._log.sync()
                self._durable(waiting)
            if dice.random() < 0.3:
                x = float(int(name) * 1000 + number)
                self._log.robot_pose(RobotPose(x=x, y=0.0, theta=0.0))
                self._say("pose", x)

    def _durable(self, keys: list[str]) -> None:
        for key in keys:
            self._say("durable", key)

    def _poll(self) -> None:
        """Ask the writer's own log."""
        while not self._over.is_set():
            self._check("the writer's own reader", self._log)
            time.sleep(0.002)

    def _refresh(self) -> None:
        """Read the files."""
        opened = sl.read(self._path)
        while not self._over.is_set():
            opened.refresh()
            self._check("a reader", opened)
            time.sleep(0.002)

    def _follow(self) -> None:
        numbers = count()
        for followed in sl.read(self._path).follow(-1, poll_s=0.003, stop=self._over.is_set):
            for recorded in followed:
                if recorded.number != (expected := next(numbers)):
                    self._say("wrong", f"follow gave event {recorded.number}, not {expected}")
                    return

    def _check(self, who: str, log: sl.DoorLog) -> None:
        numbers = [n for batch in log.batches() for n in batch.number.tolist()]
        if numbers != list(range(len(numbers))):
            self._say("wrong", f"{who} saw events with gaps: {numbers[-20:]}")

    def _noted(self, call: Callable[[], object]) -> None:
        try:
            call()
        except Exception as error:
            self._say("error", f"{type(error).__name__}: {error}")
            raise

    def _say(self, word: str, *values: object) -> None:
        self._tell(json.dumps([word, *values]))


def _slow_down(most_s: float) -> None:
    """Let writes and syncs of this process take as long as a disk's: others run meanwhile."""

    def slow(call: Callable[..., Any]) -> Callable[..., Any]:
        def called(*args: Any) -> Any:
            time.sleep(random.random() * most_s)
            return call(*args)

        return called

    for name in ("write", "fsync", "fdatasync"):
        setattr(os, name, slow(getattr(os, name)))
