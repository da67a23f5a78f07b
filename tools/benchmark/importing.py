"""Cases: a door CSV imported, against the mcap library's writer fed with the finished messages."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator
from datetime import datetime, timezone
from functools import partial
from itertools import count as counting
from pathlib import Path
from typing import Any

from benchmark.case import Case, Peer, Work
from benchmark.logs import Workshop
from benchmark.patrol import sightings

_MESSAGE = struct.Struct("<BQHIQQ")
"""An MCAP Message record up to its data: opcode, length, channel, sequence, log, publish time."""
_MESSAGE_OPCODE, _FRAME_BYTES = 5, 9

ROUNDS = 3


def import_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: the rows of a CSV file in a log of their own."""
    folder = shop.folder_for(f"import_{count}")
    csv = folder / "doors.csv"
    shop.say(f"writing a CSV of {count:,} rows")
    rows = _write_csv(csv, count)
    log, messages = folder / "sample", folder / "messages.bin"
    _import(csv, log)
    (segment,) = log.glob("*.mcap")
    _write_messages(segment, messages)
    ours = Peer("semmap-log, from the CSV", partial(_ours, csv, folder), rows, count)
    mcap = Peer("mcap writer, messages given", partial(_mcap, messages, segment, folder),
                _digest_of(segment), count, "≥ 5x")  # fmt: skip
    title = "Import of a door CSV, one commit"
    yield Case("import", title, "rows/s", (ours, mcap), rounds or ROUNDS, events=count)


def _write_csv(path: Path, count: int) -> dict[str, tuple[int, int]]:
    """Write sightings as a CSV file; return each door's last (time, state)."""
    last = {}
    with path.open("w") as file:
        file.write("timestamp,door,state,accuracy\n")
        for event in sightings(count):
            assert event.happened_ns is not None
            time = datetime.fromtimestamp(event.happened_ns // 10**9, timezone.utc)
            name = f"door {event.door_id}"
            accuracy = event.accuracy_open
            file.write(f"{time:%Y-%m-%dT%H:%M:%S}.000000,{name},{event.state.name},{accuracy}\n")
            last[name] = (event.happened_ns, int(event.state))
    return last


def _import(csv: Path, path: Path) -> Path:
    import semmap_log as sl
    from semmap_log.importing import import_file

    with sl.create(path, tz="UTC") as log:
        import_file(log, csv)
    return path


def _ours(csv: Path, folder: Path) -> Work:
    import semmap_log as sl
    from semmap_log.importing import import_file  # noqa: F401 - not timed

    def answer(path: Path) -> dict[str, tuple[int | None, int]]:
        doors = sl.read(path).replay().doors.values()
        return {door.name or "": (door.last_seen_ns, int(door.state)) for door in doors}

    logs = (folder / f"log_{i}" for i in counting())
    return Work(lambda path: _import(csv, path), logs, answer)


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
