"""Real power cuts: a real file system on a loop device is shut down while a log is written on it.

The shutdown ioctl (`godown` of the file systems' own tests) drops all that was not synced, journal
and all, in the middle of whatever is going on. Then the file system is mounted again.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import struct
import time
from collections.abc import Generator
from dataclasses import replace
from functools import partial
from pathlib import Path
from random import Random

from fault_injection.examiner import Examiner
from fault_injection.fault import Outcome, Plan, Tree, keep, read_tree, write_tree
from fault_injection.forking import Child
from fault_injection.loop_device import LoopDevice, mounted
from fault_injection.player import Player, Tell, Told
from fault_injection.story import Story, small_limits, story
from semmap_log.core.io.disk import sync_folder

USUAL_CUTS = {"ext4": 200, "xfs": 50}
IMAGE_MIB = {"ext4": 64, "xfs": 320}
MAKE = {"ext4": ["mkfs.ext4", "-q", "-F"], "xfs": ["mkfs.xfs", "-q", "-f"]}
LEVELS = ("event", "batch")
BATCH_S = 0.01
SHUTDOWN = 0x8004587D
WITHOUT_LOG_FLUSH = struct.pack("I", 2)


def cuts_on_ext4(plan: Plan) -> Generator[Outcome, None, None]:
    """Yield what became of the logs on an ext4 after each power cut."""
    yield from _cuts(plan, "ext4")


def cuts_on_xfs(plan: Plan) -> Generator[Outcome, None, None]:
    """Yield what became of the logs on an xfs after each power cut."""
    yield from _cuts(plan, "xfs")


def _cuts(plan: Plan, kind: str) -> Generator[Outcome, None, None]:
    told = story(plan.seed)
    bench = _Bench(plan, kind, told)
    with small_limits(), mounted(plan.folder, MAKE[kind], IMAGE_MIB[kind]) as disk:
        bench.look_how_long(disk)
        for number in range(plan.most(USUAL_CUTS[kind])):
            yield bench.cut(disk, number)


def _cut_power(folder: Path) -> None:
    """Lose all that was not synced on a file system, now."""
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.ioctl(fd, SHUTDOWN, WITHOUT_LOG_FLUSH)
    finally:
        os.close(fd)


class _Bench:
    """Logs of one story, at two levels at once: one is the other's load."""

    def __init__(self, plan: Plan, kind: str, told: Story) -> None:
        self._plan = plan
        self._kind = kind
        self._story = told
        self._examiner = Examiner(told)
        self._random = Random(plan.seed)
        self._whole_s = 0.0

    def look_how_long(self, disk: LoopDevice) -> None:
        """Play once to the end, so that cuts come at any moment of it."""
        start = time.monotonic()
        for child in self._writers(disk):
            ended = child.wait()
            if ended.error:
                raise RuntimeError(f"the story cannot be told: {ended.error}")
        self._whole_s = time.monotonic() - start

    def cut(self, disk: LoopDevice, number: int) -> Outcome:
        """Return what became of both logs when the power was cut once."""
        writers = self._writers(disk)
        time.sleep(self._random.uniform(0.05, 1) * self._whole_s)
        # The shutdown takes a moment, and in it a sync may still be answered with "done", though
        # its data are lost (so does a bare write + fdatasync): what was told before it must hold.
        before = [Told.of(child.heard()) for child in writers]
        _cut_power(disk.folder)
        for child in writers:
            child.kill()
        told = [
            replace(child.wait().told, durable=said.durable, exported=said.exported)
            for child, said in zip(writers, before, strict=True)
        ]
        disk.unmount()
        disk.mount()
        outcomes = [
            self._examined(f"story {self._plan.seed} ({level}) on {self._kind}, cut {number}",
                           read_tree(disk.folder / level), said)
            for level, said in zip(LEVELS, told, strict=True)
        ]  # fmt: skip
        worst = min(outcomes, key=lambda outcome: outcome.is_good)
        return replace(worst, checked=sum(outcome.checked for outcome in outcomes))

    def _examined(self, fault: str, left: Tree, told: Told) -> Outcome:
        folder = self._plan.folder / "examined"
        write_tree(folder, left)
        outcome = self._examiner.examine(fault, folder / "log", told, must=told.durable)
        if outcome.is_good:
            return outcome
        return replace(outcome, kept=keep(self._plan.keep, fault, left))

    def _writers(self, disk: LoopDevice) -> list[Child]:
        """Start a writer of each level on an empty disk."""
        for level in LEVELS:
            folder = disk.folder / level
            shutil.rmtree(folder, ignore_errors=True)
            (folder / "out").mkdir(parents=True)
            sync_folder(folder)
        sync_folder(disk.folder)
        return [Child(partial(self._write, disk.folder / level, level)) for level in LEVELS]

    def _write(self, folder: Path, level: str, tell: Tell) -> None:
        Player(folder / "log", self._story, tell, level, BATCH_S).play()
