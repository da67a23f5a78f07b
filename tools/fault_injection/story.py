"""The scripted run that every fault is thrown at: what a log's life holds, in a few dozen commits.

The same seed tells the same story: same events, ids and times. Limits are set so low that the
log rolls, splits commits into chunks and compresses them all the time.
"""

from __future__ import annotations

import hashlib
import random
import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

import numpy as np

from semmap_log.core.messages import encode
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorUpdated,
    Event,
    FloorMap,
    LevelAdded,
    LogExported,
    PatrolStarted,
    Retracted,
)

START_NS = 1_772_400_000 * 10**9
SMALL_LIMITS = {
    "ROLL_COMMITS": 7,
    "CHUNK_BYTES": 4096,
    "COMPRESS_FROM_BYTES": 3000,
    "CONTINUE_BELOW_BYTES": 38_000,
    "MOST_HELD_BACK_BYTES": 3000,
    "KEYFRAME_EVERY_BYTES": 1000,
    "KEYFRAME_RARITY": 0,
}
"""Names in the rooms of semmap_log.store; a commit of a hundred events is three chunks.

Keyframes stand within segments, and in the middle of long commits.
"""

SPARE_WISHES = 4
"""For those who go on with a log when the story has ended."""

Act = Literal["append", "repeat", "sync", "wait", "reopen", "export", "compact"]


@dataclass(frozen=True, slots=True)
class Wish:
    """A commit that the script wants in the log."""

    command_id: bytes
    events: tuple[Event, ...]
    note: Note

    def digest(self) -> bytes:
        """Return what its events say, as `digest_of` says it of those read from a log."""
        return digest_of(self.events)


@dataclass(frozen=True, slots=True)
class Story:
    """What is done, in order; `append` takes the next wish, `repeat` the last once more."""

    acts: tuple[Act, ...]
    wishes: tuple[Wish, ...]


def story(seed: int, *, tail: int = 12) -> Story:
    """Return the story of that seed: a fixed plot, then so many acts that the seed draws."""
    teller = _Teller(random.Random(seed))
    plot: list[Act] = [
        "append", "append", "repeat", "append", "append", "sync", "append", "append", "append",
        "append", "append", "reopen", "append", "append", "export", "reopen", "append", "append",
        "append", "append", "compact", "append", "repeat", "append", "sync", "append",
    ]  # fmt: skip
    drawn: list[Act] = teller.random.choices(
        ("append", "repeat", "sync", "wait", "reopen", "export", "compact"),
        (12, 2, 1, 1, 2, 1, 1),
        k=tail,
    )
    acts = (*plot, *drawn, "append")
    wishes = acts.count("append") + SPARE_WISHES
    return Story(acts, tuple(teller.wish(number) for number in range(wishes)))


class _Teller:
    """Makes wishes that the log will take, in the order in which they are made."""

    def __init__(self, random: random.Random) -> None:
        self.random = random
        self._doors: list[DoorId] = []
        self._next_id = 1
        self._event = 0
        self._time_ns = START_NS

    def wish(self, number: int) -> Wish:
        kinds = (self._first_doors, self._sightings, self._one_sighting, self._floor, self._import,
                 self._one_sighting, self._words, self._one_sighting, self._new_door,
                 self._one_sighting, self._take_back, self._sightings)  # fmt: skip
        events = tuple(kinds[number % len(kinds)]())
        self._event += len(events)
        said = Note("robot 7", "camera", f"wish {number}", salt=self._bytes(16))
        note = said if number % 3 == 1 else Note()
        return Wish(self._bytes(16), events, note)

    def _bytes(self, count: int) -> bytes:
        return self.random.randbytes(count)

    def _now(self) -> int:
        self._time_ns += self.random.randrange(1, 10**6)
        return self._time_ns

    def _door(self) -> DoorId:
        return self.random.choice(self._doors)

    def _first_doors(self) -> Iterator[Event]:
        for _ in range(3):
            yield from self._new_door()

    def _new_door(self) -> Iterator[Event]:
        door = DoorId(self._next_id)
        self._next_id += 1
        self._doors.append(door)
        x, y = (self.random.uniform(0, 20) for _ in range(2))
        yield DoorAdded(happened_ns=self._now(), door_id=door, level=0, x=x, y=y,
                        theta=0.5, width=0.9)  # fmt: skip

    def _one_sighting(self) -> Iterator[Event]:
        state = self.random.choice((DoorState.OPEN, DoorState.CLOSED))
        yield DoorObserved(happened_ns=self._now(), door_id=self._door(), state=state,
                           accuracy_open=0.9, accuracy_closed=0.8)  # fmt: skip

    def _sightings(self) -> Iterator[Event]:
        yield PatrolStarted(happened_ns=self._now(), patrol=self.random.randrange(100))
        for _ in range(self.random.randrange(2, 6)):
            yield from self._one_sighting()
        yield DoorPassed(happened_ns=self._now(), door_id=self._door(), passed=True, waited_s=1.5)

    def _import(self) -> Iterator[Event]:
        for _ in range(self.random.randrange(90, 130)):
            yield from self._one_sighting()

    def _floor(self) -> Iterator[Event]:
        level = self.random.randrange(3)
        name = f"storey {level}"
        cells = np.frombuffer(self._bytes(40 * 100), np.int8).reshape(40, 100).clip(-1, 100)
        yield LevelAdded(happened_ns=self._now(), level=level, name=name, elevation=3.0 * level)
        yield FloorMap(
            happened_ns=self._now(),
            level=level,
            resolution=0.0625,
            origin_x=1.0,
            origin_y=2.0,
            cells=cells,
        )

    def _words(self) -> Iterator[Event]:
        door = self._door()
        yield DoorAnnotated(happened_ns=self._now(), door_id=door, key="rooms",
                            value=f"ward {self.random.random()}", salt=self._bytes(16))  # fmt: skip
        yield DoorUpdated(happened_ns=self._now(), door_id=door, changed=Changed.PROB_OPEN,
                          prob_open=self.random.random())  # fmt: skip
        yield LogExported(happened_ns=self._now(), format="yaml", file_name="doors.yaml",
                          at_ns=self._time_ns)  # fmt: skip

    def _take_back(self) -> Iterator[Event]:
        last = self._event - 1
        yield Retracted(happened_ns=self._now(), first_event=last, last_event=last)
        if len(self._doors) > 3:
            door = self._doors.pop(self.random.randrange(len(self._doors)))
            yield DoorRemoved(happened_ns=self._now(), door_id=door)


def digest_of(events: tuple[Event, ...]) -> bytes:
    """Return 32 bytes that say what these events say, all of it."""
    whole = hashlib.sha256()
    for event in events:
        assert event.happened_ns is not None
        whole.update(struct.pack("<BqH", event.kind, event.happened_ns, getattr(event, "level", 0)))
        whole.update(encode(event, event.happened_ns))
    return whole.digest()


@contextmanager
def small_limits() -> Iterator[None]:
    """Make logs roll and split after a few commits, wherever these limits have been imported."""
    with constants(within="semmap_log.", **SMALL_LIMITS):
        yield


@contextmanager
def constants(*, within: str = "semmap_log.store.", **values: int) -> Iterator[None]:
    """Give constants of the log's form other values, wherever modules within have imported them."""
    modules = [m for name, m in list(sys.modules.items()) if name.startswith(within)]
    old = [(m, name, getattr(m, name)) for m in modules for name in values if hasattr(m, name)]
    assert {name for _, name, _ in old} == set(values), "a constant has another name"
    try:
        for module, name, _ in old:
            setattr(module, name, values[name])
        yield
    finally:
        for module, name, value in old:
            setattr(module, name, value)
