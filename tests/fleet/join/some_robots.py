"""Robots whose logs are joined, for the tests of a room."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

import semmap_log as sl

START_NS = 1_772_400_000 * 10**9
SECOND_NS = 10**9


class SetClock:
    """A clock that stands where it is put."""

    boot_id = bytes(16)

    def __init__(self, now_ns: int = START_NS) -> None:
        self.now_ns = now_ns

    def wall_ns(self) -> int:
        return self.now_ns

    def monotonic_ns(self) -> int:
        return 0


def seeded(seed: str) -> Callable[[int], bytes]:
    """Return ids that are the same at each run."""
    drawn = 0

    def draw(count: int) -> bytes:
        nonlocal drawn
        drawn += 1
        return sha256(f"{seed} {drawn}".encode()).digest()[:count]

    return draw


@contextmanager
def a_robot(path: Path, *, robot: str = "", clock: Any = None) -> Iterator[sl.DoorLogWriter]:
    """Make a log; it is closed behind the block."""
    options: dict[str, Any] = {"durability": "none", "compact": False}
    with sl.create(
        path, tz="UTC", robot=robot or path.name, entropy=seeded(path.name),
        clock=clock or SetClock(), **options,
    ) as log:  # fmt: skip
        yield log


def two_robots(folder: Path) -> tuple[Path, Path]:
    """Make the logs of two robots that both know the door `front`; each has one of its own."""
    clock = SetClock()
    with a_robot(folder / "tug1", clock=clock) as log:
        front = log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, name="front")
        log.add_door(x=5.0, y=2.0, theta=0.0, width=0.9, name="store")
        clock.now_ns += 10 * SECOND_NS
        log.observe(front, "open", accuracy=0.9)
    clock = SetClock(START_NS + SECOND_NS)
    with a_robot(folder / "tug2", clock=clock) as log:
        log.add_door(x=7.0, y=1.0, theta=0.0, width=0.9, name="depot")
        front = log.add_door(x=0.0, y=2.0, theta=0.0, width=0.9, name="front")
        clock.now_ns += 30 * SECOND_NS
        log.observe(front, "closed", accuracy=0.9, source="camera")
    return folder / "tug1", folder / "tug2"


def doors_of(log: sl.DoorLog, **when: Any) -> dict[str, sl.Door]:
    """Return the doors by their names."""
    return {door.label: door for door in log.replay(**when).doors.values()}


def events_of(log: sl.DoorLog) -> list[str]:
    return [repr(entry) for entry in log.history()]
