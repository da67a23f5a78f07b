"""Cases: bulk import, from a door CSV and from columns, against the mcap library's writer.

That one is given the finished messages: it only has to put them into chunks.
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from collections.abc import Iterator
from functools import partial
from itertools import count as counting
from pathlib import Path
from typing import Any

from benchmark.case import Case, Peer, Work
from benchmark.logs import Workshop
from benchmark.patrol import CLOSED, OPEN
from benchmark.peers import OURS

_MESSAGE = struct.Struct("<BQHIQQ")
"""An MCAP Message record up to its data: opcode, length, channel, sequence, log, publish time."""
_MESSAGE_OPCODE, _FRAME_BYTES = 5, 9

START_NS, STEP_NS = 1_740_873_600 * 10**9, 10**8
"""2 March 2025, and from one row to the next: a hundred million end before today.

These logs have the machine's clock, and what happened after it was recorded counts as recorded.
"""
DOORS = 100
BLOCK = 2**16
"""Rows that are made together."""
SLOW_ROWS = 100_000
"""The mcap writer is given so many messages at most, scaled."""
ROUNDS, LONG = 3, 1_000_000
"""From so many rows on each does it once, and never for warming up: it takes minutes."""

Last = dict[int, tuple[int, int]]
"""Door -> time and state of its last row."""


def import_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: sightings in a log of their own, from a CSV file and from columns."""
    folder = shop.folder_for(f"import_{count}")
    csv, sample = folder / "doors.csv", folder / "sample.csv"
    shop.say(f"writing a CSV of {count:,} rows")
    expected = _write_csv(csv, count)
    few = min(count, SLOW_ROWS)
    _write_csv(sample, few)
    (segment,) = _import(sample, folder / "sample").glob("*.mcap")
    messages = folder / "messages.bin"
    _write_messages(segment, messages)
    mcap = Peer("mcap writer, messages given", partial(_mcap, messages, segment, folder),
                _digest_of(segment), few, "≥ 5x")  # fmt: skip
    how = (rounds or (1 if count >= LONG else ROUNDS), count < LONG)
    for what, peers in (
        ("a CSV", (Peer(f"{OURS}, from the CSV", partial(_ours, csv, folder), expected, count),
                   mcap)),
        ("columns", (Peer(f"{OURS}, from columns", partial(_ours_columns, count, folder), expected,
                          count),
                     mcap,
                     Peer("limit: numpy + zstd + crc32", partial(_limit, count, folder),
                          count, count))),
    ):  # fmt: skip
        yield Case("import", f"Import of {what}, one commit", "rows/s", peers, how[0],
                   events=count, warms_up=how[1], key=f"import of {what}")  # fmt: skip


def sighting_columns(first: int, count: int) -> dict[str, Any]:
    """Return sightings of the doors 1 to 100 as columns, numbered from `first` on."""
    import numpy as np

    rng = np.random.default_rng([1, first])
    number = first + np.arange(count)
    return {
        "happened_ns": START_NS + number * STEP_NS,
        "door_id": (1 + number % DOORS).astype("u4"),
        "state": np.where(rng.random(count) < 0.3, OPEN, CLOSED).astype("u1"),
    }


def _columns(count: int) -> Iterator[dict[str, Any]]:
    for first in range(0, count, BLOCK):
        yield sighting_columns(first, min(BLOCK, count - first))


def _write_csv(path: Path, count: int) -> Last:
    """Write sightings as a CSV file; return each door's last time and state."""
    import numpy as np

    last: Last = {}
    words = np.array(["", "OPEN", "CLOSED"])
    with path.open("w") as file:
        file.write("timestamp,door,state,accuracy\n")
        for columns in _columns(count):
            times = np.datetime_as_string(columns["happened_ns"].astype("M8[ns]"), unit="us")
            doors, state = columns["door_id"].tolist(), columns["state"].tolist()
            said = words[columns["state"]].tolist()
            file.writelines(
                f"{time},door {door},{state},0.9\n"
                for time, door, state in zip(times.tolist(), doors, said, strict=True)
            )
            stamps = zip(columns["happened_ns"].tolist(), state, strict=True)
            last.update(zip(doors, stamps, strict=True))
    return last


def _import(csv: Path, path: Path) -> Path:
    import semmap_log as sl
    from semmap_log.interop.importing.importing import import_file

    with sl.create(path, tz="UTC") as log:
        import_file(log, csv)
    return path


def _ours(csv: Path, folder: Path) -> Work:
    import semmap_log as sl
    from semmap_log.interop.importing.importing import import_file  # noqa: F401 - not timed

    def answer(path: Path) -> Last:
        doors = sl.read(path).replay().doors.values()
        return {
            int((door.name or "0").split()[-1]): (door.last_seen_ns or 0, int(door.state))
            for door in doors
        }

    logs = (folder / f"log_{i}" for i in counting())
    return Work(lambda path: _import(csv, path), logs, answer)


def _ours_columns(count: int, folder: Path) -> Work:
    import semmap_log as sl
    from semmap_log.core.batches.event_batch import EventBatch
    from semmap_log.core.model.doors import DoorId
    from semmap_log.core.model.events import DoorAdded, DoorObserved

    def logs() -> Iterator[sl.DoorLogWriter]:
        for i in counting():
            log = sl.create(folder / f"columns_{i}", tz="UTC")
            log.append([DoorAdded(door_id=DoorId(door), happened_ns=START_NS)
                        for door in range(1, DOORS + 1)])  # fmt: skip
            yield log

    def once(log: sl.DoorLogWriter) -> sl.DoorLogWriter:
        with log:
            log.append(
                EventBatch.of(DoorObserved, **block, accuracy_open=0.9, accuracy_closed=0.9)
                for block in _columns(count)
            )
        return log

    def answer(log: sl.DoorLogWriter) -> Last:
        doors = sl.read(log.path).replay().doors.values()
        return {int(door.door_id): (door.last_seen_ns or 0, int(door.state)) for door in doors}

    return Work(once, logs(), answer)


def _limit(count: int, folder: Path) -> Work:
    """Return: the same columns laid out as records, compressed and written, and nothing else."""
    import numpy as np
    import zstandard

    from semmap_log.core.messages import fixed_layout
    from semmap_log.core.model.events import DoorObserved
    from semmap_log.store.byte_layout import CHUNK_BYTES, ZSTD_LEVEL

    whole = [("head", f"V{_MESSAGE.size}"), ("body", fixed_layout(DoorObserved.kind).dtype)]
    record = np.dtype(whole)
    a_chunk = CHUNK_BYTES // record.itemsize
    blocks = [sighting_columns(first, min(a_chunk, count - first))
              for first in range(0, count, a_chunk)]  # fmt: skip
    squeeze = zstandard.ZstdCompressor(ZSTD_LEVEL)

    def once(path: Path) -> int:
        rows = crcs = 0
        with path.open("wb") as file:
            for block in blocks:
                laid = np.zeros(len(block["state"]), record)
                for name in ("door_id", "state"):
                    laid["body"][name] = block[name]
                data = laid.tobytes()
                crcs += zlib.crc32(data)
                file.write(squeeze.compress(data))
                rows += len(laid)
        return rows

    return Work(once, (folder / f"limit_{i}" for i in counting()))


def _write_messages(segment: Path, path: Path) -> None:
    """Write all messages of an MCAP file, one behind the other, as MCAP's own Message records."""
    from mcap.reader import make_reader

    with segment.open("rb") as source, path.open("wb") as file:
        for _, _, message in make_reader(source).iter_messages():
            length = _MESSAGE.size - _FRAME_BYTES + len(message.data)
            file.write(_MESSAGE.pack(_MESSAGE_OPCODE, length, message.channel_id, message.sequence,
                                     message.log_time, message.publish_time))  # fmt: skip
            file.write(message.data)


def _mcap(messages: Path, segment: Path, folder: Path) -> Work:
    from mcap.reader import make_reader
    from mcap.writer import Writer

    with segment.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None

    def once(path: Path) -> Path:
        with path.open("wb") as file:
            writer = Writer(file)
            writer.start(profile="ros2")
            schema_of = {
                schema.id: writer.register_schema(schema.name, schema.encoding, schema.data)
                for schema in summary.schemas.values()
            }
            channel_of = {
                channel.id: writer.register_channel(
                    channel.topic, channel.message_encoding, schema_of[channel.schema_id]
                )
                for channel in summary.channels.values()
            }
            for channel, sequence, log_time, publish_time, data in _messages(messages):
                writer.add_message(channel_of[channel], log_time, data, publish_time, sequence)
            writer.finish()
        return path

    return Work(once, (folder / f"written_{i}.mcap" for i in counting()), _digest_of)


def _messages(path: Path) -> Iterator[tuple[int, int, int, int, bytes]]:
    """Yield channel, sequence, log time, publish time and data of records in a file."""
    with path.open("rb") as file:
        while head := file.read(_MESSAGE.size):
            _, length, channel, sequence, log, publish = _MESSAGE.unpack(head)
            data = file.read(length + _FRAME_BYTES - _MESSAGE.size)
            yield channel, sequence, log, publish, data


def _digest_of(path: Path) -> str:
    """Return a digest of all messages of an MCAP file, as the mcap library reads them."""
    from mcap.reader import make_reader

    digest = hashlib.sha256()
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            said: tuple[Any, ...] = (channel.topic, message.sequence, message.log_time,
                                     message.publish_time, message.data)  # fmt: skip
            digest.update(repr(said).encode())
    return digest.hexdigest()
