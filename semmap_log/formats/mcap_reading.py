"""An MCAP file of ROS messages, of either ROS, with an index or without."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from struct import Struct
from typing import Any, BinaryIO
from zlib import crc32

from semmap_log.errors import FormatError
from semmap_log.formats.bag_reading import BagChannel, BagMessage
from semmap_log.formats.files import open_regular
from semmap_log.formats.ros_decoding import DefinitionForm, MessageType
from semmap_log.formats.ros_types import RosVersion, long_name

FOOTER_BYTES = 37
_FOOTER = Struct("<BQQQI")
"""Opcode, length; where the summary starts (0: there is none), and its offsets; CRC of all that."""
MAGIC = b"\x89MCAP0\r\n"
OUR_TYPES = "semmap_msgs/"

REORDERED_BYTES = 64 * 2**20
"""Of a file without an index so much waits in memory, to come in the order of its times."""

_ENCODINGS: dict[str, RosVersion] = {"ros1": 1, "cdr": 2}
_FORMS: dict[str, DefinitionForm] = {
    "ros1msg": "msg",
    "ros2msg": "msg",
    "ros2idl": "idl",
    "omgidl": "idl",
}


class McapBag:
    """A file that is open; the mcap library reads it."""

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self._path = path
        self._file = file
        with _troubles(path):
            self._summary = self._reader().get_summary()
        is_indexed = self._summary is not None and bool(self._summary.chunk_indexes)
        self._is_indexed = is_indexed
        self._channels = self._indexed_channels() if is_indexed else self._scanned_channels()
        for channel in self._channels.values():
            if channel.message_type.name.startswith(OUR_TYPES):
                raise own_log(path)

    @classmethod
    def open(cls, path: Path, stack: ExitStack) -> McapBag:
        """Open a file, which the stack closes.

        Raises:
            FormatError: It cannot be read, is unfinished, or a segment of a log of ours.
        """
        file = stack.enter_context(open_regular(path))
        _check_ends(path, file)
        return cls(path, file)

    @property
    def channels(self) -> Collection[BagChannel]:
        """All that hold ROS messages."""
        return list(dict.fromkeys(self._channels.values()))

    def count(self, channels: Collection[BagChannel]) -> int:
        """Return how many messages the summary tells of; 0: it does not say."""
        statistics = self._summary.statistics if self._summary else None
        counts = statistics.channel_message_counts if statistics else {}
        return sum(counts.get(i, 0) for i, each in self._channels.items() if each in channels)

    def messages(self, channels: Collection[BagChannel]) -> Iterator[BagMessage]:
        """Yield the messages of these channels, times ascending."""
        topics = {channel.topic for channel in channels}
        chosen = {i: each for i, each in self._channels.items() if each in channels}
        if not chosen:
            return
        with _troubles(self._path):
            found = self._reader().iter_messages(topics, log_time_order=self._is_indexed)
            messages = (
                BagMessage(chosen[channel.id], message.log_time, message.data)
                for _, channel, message in found
                if channel.id in chosen
            )
            ordered = messages if self._is_indexed else in_order(messages, self._path)
            yield from _counted(ordered, self._told_count(channels), self._path)

    def _told_count(self, channels: Collection[BagChannel]) -> int | None:
        """Return how many messages there have to be; None: the summary does not say."""
        statistics = self._summary.statistics if self._summary else None
        return self.count(channels) if statistics and statistics.channel_message_counts else None

    def _reader(self) -> Any:
        from mcap.reader import make_reader

        self._file.seek(0)
        return make_reader(self._file, validate_crcs=True)

    def _indexed_channels(self) -> dict[int, BagChannel]:
        found = {}
        for number, channel in self._summary.channels.items():
            made = _channel(channel, self._summary.schemas.get(channel.schema_id))
            if made is not None:
                found[number] = made
        return found

    def _scanned_channels(self) -> dict[int, BagChannel]:
        """Return the channels of a file that tells nothing of them at its end."""
        from mcap.records import Channel, Schema
        from mcap.stream_reader import StreamReader

        schemas: dict[int, Any] = {}
        found: dict[int, BagChannel] = {}
        self._file.seek(0)
        with _troubles(self._path):
            for record in StreamReader(self._file, validate_crcs=True).records:
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    made = _channel(record, schemas.get(record.schema_id))
                    if made is not None:
                        found[record.id] = made
        return found


def _counted(
    messages: Iterator[BagMessage], expected: int | None, path: Path
) -> Iterator[BagMessage]:
    """Yield messages, and raise FormatError if there are fewer, or more, than there have to be."""
    count = 0
    for message in messages:
        count += 1
        yield message
    if expected not in (None, count):
        raise FormatError(
            path, f"expected {expected:,} messages, as the file itself says, got {count:,}; "
            "mend a copy: mcap recover",
        )  # fmt: skip


def in_order(messages: Iterator[BagMessage], path: Path) -> Iterator[BagMessage]:
    """Yield messages that come about in order, times ascending.

    Raises:
        FormatError: One comes too late: more than `REORDERED_BYTES` lie between.
    """
    heap: list[tuple[int, int, BagMessage]] = []
    waiting = last_ns = 0
    for number, message in enumerate(messages):
        if message.at_ns < last_ns:
            raise FormatError(
                path,
                "it has no index, and its times go back and forth too far to be read in order; "
                "write it anew in order: mcap sort",
            )
        heapq.heappush(heap, (message.at_ns, number, message))
        waiting += len(message.data)
        while waiting > REORDERED_BYTES:
            last_ns, _, first = heapq.heappop(heap)
            waiting -= len(first.data)
            yield first
    while heap:
        yield heapq.heappop(heap)[2]


def own_log(path: Path) -> FormatError:
    """Return the error that says that it is no bag but a log of ours."""
    return FormatError(
        path,
        "this is a log of semmap-log, or a part of one, no bag; to take its events into another "
        "log: semmap-log export LOG events.jsonl, then import that",
    )


def _channel(channel: Any, schema: Any) -> BagChannel | None:
    """Return a channel as we read it; None: its messages are not ROS's."""
    version = _ENCODINGS.get(channel.message_encoding)
    if version is None or schema is None:
        return None
    form = _FORMS.get(schema.encoding, "msg")
    text = schema.data.decode(errors="replace") if schema.encoding in _FORMS else ""
    return BagChannel(channel.topic, MessageType(long_name(schema.name), version, text, form))


def _check_ends(path: Path, file: BinaryIO) -> None:
    """Return if the file is an MCAP that was closed.

    Raises:
        FormatError: It is not.
    """
    if file.read(len(MAGIC)) != MAGIC:
        raise FormatError(path, "expected an MCAP file, got something else")
    size = file.seek(0, 2)
    file.seek(max(0, size - FOOTER_BYTES))
    if size < FOOTER_BYTES or not file.read().endswith(MAGIC):
        file.seek(0)
        head = file.read(2**16)
        if OUR_TYPES.encode() in head:
            raise own_log(path)
        raise FormatError(
            path, "its end was never written (the recorder was killed?) or is lost; mend a copy: "
            "mcap recover",
        )  # fmt: skip
    _check_summary(path, file, size - FOOTER_BYTES)


def _check_summary(path: Path, file: BinaryIO, footer_at: int) -> None:
    """Return if what the file says of itself at its end is as it was written.

    The library does not look: by a damaged index whole chunks are passed over in silence.

    Raises:
        FormatError: It is not.
    """
    file.seek(footer_at)
    _, _, starts_at, _, expected = _FOOTER.unpack(file.read(_FOOTER.size))
    if not expected:
        return  # whoever wrote it left that out
    file.seek(min(starts_at or footer_at, footer_at))
    left, crc = footer_at + _FOOTER.size - 4 - file.tell(), 0
    while left > 0 and (block := file.read(min(left, 2**20))):
        left, crc = left - len(block), crc32(block, crc)
    if crc != expected:
        raise FormatError(path, "damaged: its summary is not as it was written; mend a copy: "
                          "mcap recover")  # fmt: skip


@contextmanager
def _troubles(path: Path) -> Iterator[None]:
    """Turn whatever the library raises of damaged bytes into our error."""
    try:
        yield
    except FormatError:
        raise
    except Exception as error:
        reason = str(error) or type(error).__name__
        raise FormatError(path, f"damaged: {reason}; mend a copy: mcap recover") from error
