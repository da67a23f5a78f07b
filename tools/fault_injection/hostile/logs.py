"""Logs of ours that ask for much: sound by all checksums, or valid events that tempt into work."""

from __future__ import annotations

import base64
import hashlib
import random
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, reduce
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import zstandard

import semmap_log as sl
from fault_injection.judging import commit_places
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    ClassDefined,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorUpdated,
    Event,
    FloorMap,
    LevelAdded,
    MomentPinned,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    RobotPose,
    SightingsThinned,
)
from semmap_log.store import records as mcap

_CHUNK = 6
_MIB = bytes(2**20)


def hostile_log(path: Path, dice: random.Random) -> str:
    """Write a log's folder; return what is wrong with it, in words."""
    ways = (_chunk_of_zeros, _chunk_of_messages, _index_of_zeros, _huge_numbers, _zeros_behind,
            _huge_metadata)  # fmt: skip
    return dice.choice(ways)(path, dice)


def good_log(path: Path, *, closed: bool = True) -> Path:
    """Write a small log; return its segment.

    Args:
        path: Its folder.
        closed: Whether the segment is; else nothing else is in the folder.
    """
    log = sl.create(path, tz="UTC", compact=False)
    door = log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, name="front")
    for i in range(6):
        log.observe(door, ("open", "closed")[i % 2])
    segment = max(path.glob("*.mcap"))
    live = segment.read_bytes()
    log.close()
    if not closed:
        segment.write_bytes(live)
        for other in path.iterdir():
            if other != segment:
                other.unlink()
    return segment


def _chunk_of_zeros(path: Path, dice: random.Random) -> str:
    """A live segment that ends with a chunk of very many bytes, by its checksum all there."""
    mib = dice.choice((256, 1023))
    segment = good_log(path, closed=False)
    packed = _zeros_by_zstd(mib)
    data = bytearray(segment.read_bytes())
    body = struct.pack("<QQQI", 2**61, 2**61, mib * 2**20, _crc_of_zeros(mib))
    body += struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed
    at = len(data)
    if dice.random() < 0.5:
        at = commit_places(segment)[3][0]
        del data[at:]
    data += struct.pack("<BQ", _CHUNK, len(body)) + body
    segment.write_bytes(data)
    return f"a live log with a chunk of {mib} MiB zeros at byte {at}"


def _chunk_of_messages(path: Path, dice: random.Random) -> str:
    """A live segment that ends with chunks of very many messages which are all alike."""
    channel, chunks = dice.choice((4, 50, 90, 91, 92)), dice.choice((1, 6))
    segment = good_log(path, closed=False)
    message = mcap.message(channel, 8, 2**61, 2**61, b"")
    records = message * (2**27 // len(message))
    packed = zstandard.compress(records, 1)
    body = struct.pack("<QQQI", 2**61, 2**61, len(records), zlib.crc32(records))
    body += struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed
    with segment.open("ab") as file:
        file.write((struct.pack("<BQ", _CHUNK, len(body)) + body) * chunks)
    return f"a live log with {chunks} chunks of {len(records)} bytes of messages that are all alike"


def _index_of_zeros(path: Path, dice: random.Random) -> str:
    """A closed segment whose index of times unpacks to very many."""
    mib = dice.choice((256, 1024))
    packed = base64.b64encode(_zeros_by_zlib(mib)).decode()
    with _index_entries(packed, dice.choice((("events",), ("events", "greatest_happened_ns")))):
        good_log(path)
    return f"a closed log whose index unpacks to {mib} MiB"


@contextmanager
def _index_entries(packed: str, names: tuple[str, ...]) -> Iterator[None]:
    """Have closed segments get other entries in their index, with the digest that fits."""
    import semmap_log.store.segment as where

    usual = where.index_metadata

    def made(*arguments: Any) -> Any:
        metadata = usual(*arguments)
        entries = {k: v for k, v in metadata.metadata.items() if k != "sha256"}
        entries |= dict.fromkeys(names, packed)
        lines = "".join(f"{key}\0{entries[key]}\n" for key in sorted(entries))
        metadata.metadata = {**entries, "sha256": hashlib.sha256(lines.encode()).hexdigest()}
        return metadata

    with patch.object(where, "index_metadata", made):
        yield


def _huge_numbers(path: Path, dice: random.Random) -> str:
    """A segment with some lengths made huge."""
    segment = good_log(path, closed=dice.random() < 0.5)
    data = bytearray(segment.read_bytes())
    changes = []
    for _ in range(dice.randint(1, 3)):
        size = dice.choice((4, 8))
        at = dice.randrange(len(data) - 8)
        value = dice.choice((2**31 - 1, 2**32 - 1, 2**40, 2**63 - 1, 2**64 - 1)) % 2 ** (8 * size)
        data[at : at + size] = value.to_bytes(size, "little")
        changes.append(f"{value} at byte {at}")
    segment.write_bytes(data)
    return f"a log with {', '.join(changes)}"


def _zeros_behind(path: Path, dice: random.Random) -> str:
    """A live segment with a long hole behind it, or full of bytes that look like chunks."""
    segment = good_log(path, closed=False)
    size = dice.choice((2**28, 2**32))
    if dice.random() < 0.5:
        with segment.open("r+b") as file:
            file.truncate(size)
        return f"a live log with a hole up to {size} bytes"
    head = struct.pack("<BQ", _CHUNK, dice.choice((100, 2**20, 2**40)))
    with segment.open("ab") as file:
        file.write(head * (2**22 // len(head)))
    return "a live log with 4 MiB of heads of chunks behind it"


def _huge_metadata(path: Path, dice: random.Random) -> str:
    """A log whose other files are huge or deep."""
    good_log(path)
    others = sorted(p for p in path.iterdir() if p.suffix != ".mcap" and p.name != ".lock")
    name = dice.choice(others).name
    what, data = dice.choice((
        ("deep", b"[" * 10**6),
        ("deep objects", b'{"a":' * 10**6),
        ("60 MB long", b"x" * 60_000_000),
        ("a long number", b"9" * 3_000_000),
    ))  # fmt: skip
    (path / name).write_bytes(data)
    return f"a log whose {name} is {what}"


@cache
def _zeros_by_zstd(mib: int) -> bytes:
    packing = zstandard.ZstdCompressor(level=1).compressobj(size=mib * 2**20)
    return b"".join(packing.compress(_MIB) for _ in range(mib)) + packing.flush()


@cache
def _zeros_by_zlib(mib: int) -> bytes:
    packing = zlib.compressobj(9)
    return b"".join(packing.compress(_MIB) for _ in range(mib)) + packing.flush()


@cache
def _crc_of_zeros(mib: int) -> int:
    return reduce(lambda crc, _: zlib.crc32(_MIB, crc), range(mib), 0)


S, DAY, YEAR = 10**9, 86_400 * 10**9, 31_557_600 * 10**9
NOW = 1_772_478_000 * S
"""In the evening of the recording's day."""
LATE = 2**63 - 2**54
"""In 2261."""
FAR = (1e6, 1e9, 1e15, 1e300)

Touch = Callable[[random.Random], Iterator[Event]]


def costly_log(log: Path, dice: random.Random) -> str:
    """Add something to a log that makes it costly to answer; return what, in words."""
    touches = dice.sample(TOUCHES, dice.choice((1, 1, 2)))
    clock = [NOW]
    if dice.random() < 0.2:
        clock[0] = dice.choice((NOW + 10 * YEAR, NOW + 174 * YEAR, LATE))
    with (
        patch("time.time_ns", lambda: clock[0]),
        sl.append(log, durability="flush", compact=False) as opened,
    ):
        for touch in touches:
            events = list(touch(dice))
            for start in range(0, len(events), 50):
                clock[0] += S
                opened.append(events[start : start + 50])
    when = "" if clock[0] < NOW + YEAR else f", by a clock in {1970 + clock[0] // YEAR}"
    return " and ".join(touch.__name__.lstrip("_").replace("_", " ") for touch in touches) + when


def _seen(door: int, at: int | None, dice: random.Random) -> Event:
    state = dice.choice((DoorState.OPEN, DoorState.CLOSED))
    return DoorObserved(door_id=DoorId(door), state=state, accuracy_open=0.9, accuracy_closed=0.9,
                        happened_ns=at)  # fmt: skip


def _placed(door: int, x: float = 1.0, y: float = 1.0, **more: Any) -> Event:
    place: dict[str, Any] = {"level": 0, "x": x, "y": y, "theta": 0.0, "width": 0.9}
    return DoorAdded(door_id=DoorId(door), **(place | more))


def _clock_at_1970(dice: random.Random) -> Iterator[Event]:
    """Doors added while the clock was at 1970, and seen then."""
    count = dice.choice((1, 5, 20))
    for i in range(count):
        yield _placed(100 + i, x=float(i), happened_ns=(60 + i) * S)
        yield _seen(100 + i, (120 + i) * S, dice)
    for day in range(7):
        for i in range(count):
            yield _seen(100 + i, NOW - day * DAY - i * S, dice)


def _one_sighting_years_away(dice: random.Random) -> Iterator[Event]:
    yield _seen(1, max(0, NOW - dice.choice((2, 20, 56)) * YEAR), dice)
    yield _seen(1, None, dice)


def _a_sighting_each_year(dice: random.Random) -> Iterator[Event]:
    for year in range(50):
        yield _seen(dice.choice((1, 2)), NOW - year * YEAR - dice.randrange(DAY), dice)


def _sightings_to_come(dice: random.Random) -> Iterator[Event]:
    for _ in range(20):
        yield _seen(1, dice.choice((NOW + YEAR, NOW + 100 * YEAR, LATE)), dice)


def _huge_ids(dice: random.Random) -> Iterator[Event]:
    for door in (2**31 - 1, 2**31, 2**32 - 1):
        yield _placed(door)
        yield _seen(door, None, dice)


def _far_away(dice: random.Random) -> Iterator[Event]:
    far = dice.choice(FAR)
    yield _placed(201, x=far, y=-far)
    yield _placed(202, x=-far, y=far, theta=dice.choice((0.5, 1e15)))


def _wide(dice: random.Random) -> Iterator[Event]:
    yield _placed(203, width=dice.choice((*FAR, 1e-300)))


def _many_levels(dice: random.Random) -> Iterator[Event]:
    for level in dice.sample(range(1, 65_000), 60):
        yield LevelAdded(level=level, name=f"level {level}", elevation=dice.choice((3.0, 1e300)))
        yield _placed(1000 + level, level=level)


def _huge_rounds(dice: random.Random) -> Iterator[Event]:
    for patrol in (2**31, 2**32 - 2):
        yield PatrolStarted(patrol=patrol)
        yield _seen(1, None, dice)
        yield PatrolFinished(patrol=patrol)


def _a_round_without_end(dice: random.Random) -> Iterator[Event]:
    yield PatrolStarted(patrol=7, happened_ns=dice.choice((0, NOW - 50 * YEAR)))
    yield PatrolFinished(patrol=7)


def _long_words(dice: random.Random) -> Iterator[Event]:
    for i in range(5):
        yield DoorAnnotated(door_id=DoorId(1), key=dice.choice(("name", f"key {i}", "rooms")),
                            value=dice.choice("x,\n\u202e") * 60_000)  # fmt: skip


def _many_keys(_: random.Random) -> Iterator[Event]:
    for i in range(500):
        yield DoorAnnotated(door_id=DoorId(1), key=f"key {i}", value=f"{i}")


def _polygon_of_many_corners(dice: random.Random) -> Iterator[Event]:
    far = dice.choice((1.0, 1e4, 1e9))
    corners = " ".join(
        f"{dice.uniform(0, far):.3g},{dice.uniform(0, far):.3g}" for _ in range(4000)
    )
    yield ClassDefined(class_name="zone", geometry="polygon", states="FREE,BUSY", blocks="BUSY")
    yield _placed(204)
    yield DoorAnnotated(door_id=DoorId(204), key="class", value="zone")
    yield DoorAnnotated(door_id=DoorId(204), key="outline", value=corners)


def _poses_far_apart(dice: random.Random) -> Iterator[Event]:
    far = dice.choice(FAR)
    for i in range(100):
        yield RobotPose(level=0, x=dice.uniform(-far, far), y=0.0, theta=float(i))


def _a_floor_of_odd_size(dice: random.Random) -> Iterator[Event]:
    resolution, side = dice.choice(
        ((1e-30, 2), (1e-6, 2), (1e-3, 900), (1e6, 300), (1e30, 2), (0.05, 1200))
    )
    at = dice.choice((0.0, 1e9, 1e300))
    cells = np.zeros((side, side), np.int8)
    cells[:: max(2, side // 50)] = 100
    yield FloorMap(level=0, resolution=resolution, origin_x=at, origin_y=-at, cells=cells)


def _a_pin_that_unpacks(dice: random.Random) -> Iterator[Event]:
    packed = zlib.compress(bytes(dice.choice((50, 300)) * 2**20), 9)
    yield MomentPinned(at_ns=NOW - DAY // 4, next_event=50, name="huge",
                       keyframe=base64.b64encode(packed).decode())  # fmt: skip


def _thinned_without_end(dice: random.Random) -> Iterator[Event]:
    first, last = dice.choice(((0, LATE), (NOW - 3600 * S, NOW), (0, 3600 * S)))
    for door in (1, 2):
        yield SightingsThinned(door_id=DoorId(door), state=DoorState.OPEN, count=2**32 - 1,
                               first_ns=first, last_ns=last, happened_ns=last)  # fmt: skip


def _much_taken_back(dice: random.Random) -> Iterator[Event]:
    for last in range(60, 216):
        if last != 76:  # which is a retraction
            yield Retracted(first_event=dice.randrange(20, 60), last_event=last)
            yield _seen(1, None, dice)


def _waited_for_ever(_: random.Random) -> Iterator[Event]:
    for waited in (1e18, 1e300, 1e-300):
        yield DoorPassed(door_id=DoorId(1), passed=True, waited_s=waited)


def _moved_to_and_fro(dice: random.Random) -> Iterator[Event]:
    for _ in range(100):
        far = dice.choice((1.0, 50.0, *FAR[:2]))
        yield DoorUpdated(door_id=DoorId(1), changed=Changed.POSE, level=0, width=0.9, theta=0.0,
                          x=dice.uniform(-far, far), y=dice.uniform(-far, far))  # fmt: skip


def _many_doors(dice: random.Random) -> Iterator[Event]:
    for i in range(300):
        yield _placed(300 + i, x=dice.uniform(0, 40), y=dice.uniform(0, 40))


TOUCHES: tuple[Touch, ...] = (
    _clock_at_1970, _one_sighting_years_away, _a_sighting_each_year, _sightings_to_come, _huge_ids,
    _far_away, _wide, _many_levels, _huge_rounds, _a_round_without_end, _long_words, _many_keys,
    _polygon_of_many_corners, _poses_far_apart, _a_floor_of_odd_size, _a_pin_that_unpacks,
    _thinned_without_end, _much_taken_back, _waited_for_ever, _moved_to_and_fro, _many_doors,
)  # fmt: skip
