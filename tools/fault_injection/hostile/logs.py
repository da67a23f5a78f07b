"""Logs of ours, as a stranger might make them: sound by all checksums, and asking for much."""

from __future__ import annotations

import base64
import hashlib
import random
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, reduce
from pathlib import Path
from typing import Any
from unittest.mock import patch

import zstandard

import semmap_log as sl
from fault_injection.judging import commit_places
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
