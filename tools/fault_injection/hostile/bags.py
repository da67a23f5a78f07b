"""Bags of both ROS versions that hold bombs, or lie about lengths and counts."""

from __future__ import annotations

import random
import struct
from functools import cache
from pathlib import Path
from typing import Any

import zstandard

from fault_injection.hostile.packed import bz2_zeros, crc_of_zeros, lz4_zeros, zstd_zeros

MAGIC = b"\x89MCAP0\r\n"
DEFINITION = b"""builtin_interfaces/Time door_time
string door_name
rmf_door_msgs/DoorMode current_mode
================================================================================
MSG: rmf_door_msgs/DoorMode
uint32 value
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
HUGE = (2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**62, 2**63 - 1, 2**63, 2**64 - 1)


def mcap_bomb(path: Path, dice: random.Random) -> str:
    """Write an MCAP file with one chunk of zeros; return what it is, in words."""
    mib = dice.choice((64, 512, 1024))
    compression = dice.choice(("zstd", "zstd", "lz4"))
    says_size = dice.random() < 0.5
    packed = zstd_zeros(mib, says_size=says_size) if compression == "zstd" else lz4_zeros(mib // 4)
    real = mib * 2**20 if compression == "zstd" else mib // 4 * 2**20
    declared = dice.choice((real, real, 0, 100, 2**40, 2**63 - 1))
    crc = dice.choice((0, crc_of_zeros(real // 2**20)))
    chunk = struct.pack("<QQQI", 1, 2, declared, crc) + _text(compression.encode())
    chunk += struct.pack("<Q", len(packed)) + packed
    has_summary = dice.random() < 0.5
    path.write_bytes(_mcap([_record(6, chunk)], has_summary=has_summary, size=declared))
    return f"{compression} chunk of {real // 2**20} MiB zeros that says {declared}"


def mcap_of_many(path: Path, dice: random.Random) -> str:
    """Write an MCAP file with chunks of very many messages, or of large ones; all are good."""
    count = dice.choice((1, 5_000_000))
    body = struct.pack("<HIQQ", 1, 0, 1, 1) + bytes(0 if count > 1 else 120 * 2**20)
    inside = _record(5, body) * min(count, 2**27 // (9 + len(body)))
    packed = zstandard.compress(inside, 1)
    chunk = struct.pack("<QQQI", 1, 2, len(inside), 0) + _text(b"zstd")
    chunk += struct.pack("<Q", len(packed)) + packed
    chunks = dice.choice((1, 50))
    path.write_bytes(_mcap([_record(6, chunk)] * chunks, has_summary=False, size=len(inside)))
    return f"{chunks} chunks of {len(inside)} bytes of messages of {len(body)} bytes"


def mcap_liar(path: Path, dice: random.Random) -> str:
    """Write a good MCAP file with some numbers made huge."""
    data = bytearray(good_mcap())
    changes = []
    for _ in range(dice.randint(1, 3)):
        at, size = dice.choice(_numbers_of(bytes(data)))
        value = dice.choice(HUGE) % 2 ** (8 * size)
        data[at : at + size] = value.to_bytes(size, "little")
        changes.append(f"{value} at byte {at}")
    path.write_bytes(data)
    return f"an MCAP file with {', '.join(changes)}"


def bag_bomb(path: Path, dice: random.Random) -> str:
    """Write a bag of ROS 1 with one chunk of zeros."""
    mib = dice.choice((64, 512, 1024))
    compression = dice.choice((b"bz2", b"lz4"))
    packed = bz2_zeros(mib) if compression == b"bz2" else lz4_zeros(mib // 4)
    declared = dice.choice((mib * 2**20, 100, 2**32 - 1)) % 2**32
    chunk = _bag_record(
        {b"op": b"\x05", b"compression": compression, b"size": struct.pack("<I", declared)}, packed
    )
    path.write_bytes(_bag(chunk))
    return f"{compression.decode()} chunk of {mib} MiB zeros that says {declared}"


def bag_liar(path: Path, dice: random.Random) -> str:
    """Write a bag of ROS 1 with some numbers made huge, or cut."""
    data = bytearray(good_bag())
    start = data.index(b"\n") + 1
    changes = []
    for _ in range(dice.randint(1, 3)):
        at = dice.randrange(start, min(len(data) - 4, start + 200)) if dice.random() < 0.5 else (
            dice.choice([i for i in range(start, len(data) - 4) if data[i : i + 3].count(0) == 3])
        )  # fmt: skip
        value = dice.choice((2**31 - 1, 2**31, 2**32 - 1, 0, dice.randrange(2**32)))
        data[at : at + 4] = value.to_bytes(4, "little")
        changes.append(f"{value} at byte {at}")
    path.write_bytes(data[: dice.choice((len(data), len(data), dice.randrange(len(data))))])
    return f"a bag with {', '.join(changes)}"


def good_bag() -> bytes:
    """Return a bag of ROS 1 with a chunk that is empty."""
    header = {b"op": b"\x05", b"compression": b"none", b"size": struct.pack("<I", 0)}
    return _bag(_bag_record(header, b""))


def _text(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def _record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def _head_records() -> bytes:
    schema = struct.pack("<H", 1) + _text(b"rmf_door_msgs/msg/DoorState") + _text(b"ros2msg")
    channel = struct.pack("<HH", 1, 1) + _text(b"/door_states") + _text(b"cdr") + _text(b"")
    return _record(3, schema + _text(DEFINITION)) + _record(4, channel)


def _mcap(records: list[bytes], *, has_summary: bool, size: int) -> bytes:
    data = MAGIC + _record(1, _text(b"ros2") + _text(b"made"))
    data += _head_records()
    at = len(data)
    data += b"".join(records) + _record(15, struct.pack("<I", 0))
    start = len(data)
    summary = b""
    if has_summary:
        stored = len(records[0])
        index = struct.pack("<QQQQ", 1, 2, at, stored) + _text(b"") + struct.pack("<Q", 0)
        index += _text(b"zstd") + struct.pack("<QQ", stored, size % 2**64)
        statistics = struct.pack("<QHIIIIQQ", 1, 1, 1, 0, 0, 1, 1, 2) + _text(b"")
        summary = _head_records() + _record(11, statistics) + _record(8, index)
    footer = struct.pack("<QQI", start if has_summary else 0, 0, 0)
    return data + summary + _record(2, footer) + MAGIC


@cache
def good_mcap() -> bytes:
    """Return a file with three sightings, as the mcap library writes it."""
    import io

    from mcap.writer import CompressionType, Writer

    out = io.BytesIO()
    writer = Writer(out, compression=CompressionType.NONE)
    writer.start("ros2", "made")
    schema = writer.register_schema("rmf_door_msgs/msg/DoorState", "ros2msg", DEFINITION)
    channel = writer.register_channel("/door_states", "cdr", schema)
    for i in range(3):
        data = b"\0\1\0\0" + struct.pack("<iI", 1_772_400_000 + i, 0)
        data += struct.pack("<I6sxxI", 6, b"front\0", i % 2)
        time = (1_772_400_000 + i) * 10**9
        writer.add_message(channel, time, data, time)
    writer.add_metadata("more", {"key": "value"})
    writer.finish()
    return out.getvalue()


def _numbers_of(data: bytes) -> list[tuple[int, int]]:
    """Return where lengths and other numbers lie: byte, size."""
    found, at = [], len(MAGIC)
    while at + 9 <= len(data) - len(MAGIC):
        (length,) = struct.unpack_from("<Q", data, at + 1)
        found.append((at + 1, 8))
        if length > len(data):
            break
        for i in range(at + 9, at + 9 + length - 8):
            if data[i] and not any(data[i + 2 : i + 4]) and i + 8 < len(data):
                found += [(i, 4), (i, 8)]
        at += 9 + length
    return found


def _bag_record(header: dict[bytes, bytes], data: bytes) -> bytes:
    fields = b"".join(
        struct.pack("<I", len(k) + 1 + len(v)) + k + b"=" + v for k, v in header.items()
    )
    return struct.pack("<I", len(fields)) + fields + struct.pack("<I", len(data)) + data


def _bag(chunk: bytes) -> bytes:
    """Return a bag with that chunk, a connection, and the chunk's info."""
    numbers: dict[str, Any] = {"conn": 1, "chunk": 1}
    magic = b"#ROSBAG V2.0\n"
    chunk_at = len(magic) + 4096
    connection = _bag_record(
        {b"op": b"\x07", b"conn": struct.pack("<I", 0), b"topic": b"/door_states"},
        _bag_fields({
            b"topic": b"/door_states", b"type": b"std_msgs/Int32",
            b"md5sum": b"da5909fbe378aeaf85e547e830cc1bb7", b"message_definition": b"int32 data\n",
        }),
    )  # fmt: skip
    info = _bag_record(
        {
            b"op": b"\x06", b"ver": struct.pack("<I", 1), b"chunk_pos": struct.pack("<Q", chunk_at),
            b"start_time": struct.pack("<II", 1, 0), b"end_time": struct.pack("<II", 2, 0),
            b"count": struct.pack("<I", 1),
        },
        struct.pack("<II", 0, 1),
    )  # fmt: skip
    entries = struct.pack("<III", 1, 0, 0)
    index = _bag_record(
        {b"op": b"\x04", b"ver": struct.pack("<I", 1), b"conn": struct.pack("<I", 0),
         b"count": struct.pack("<I", 1)}, entries,
    )  # fmt: skip
    head = {
        b"op": b"\x03",
        b"index_pos": struct.pack("<Q", chunk_at + len(chunk) + len(index)),
        b"conn_count": struct.pack("<I", numbers["conn"]),
        b"chunk_count": struct.pack("<I", numbers["chunk"]),
    }
    empty = _bag_record(head, b"")
    padded = _bag_record(head, b" " * (4096 - len(empty)))
    return magic + padded + chunk + index + connection + info


def _bag_fields(fields: dict[bytes, bytes]) -> bytes:
    return b"".join(
        struct.pack("<I", len(k) + 1 + len(v)) + k + b"=" + v for k, v in fields.items()
    )
