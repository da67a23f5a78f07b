"""What a bag is, whoever wrote it: its topics and messages, read and written.

It also has the MCAP formats: reads a file of ROS messages, of either ROS, with an index or
without; writes ROS 2 messages as one closed file, in zstd chunks, indexed, with CRCs.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from struct import Struct, unpack_from
from typing import Any, BinaryIO, Protocol
from zlib import crc32

from semmap_log.core.messages import LIBRARY, PROFILE, TRANSIENT_LOCAL, VOLATILE, offered_qos
from semmap_log.core.texts import command_line
from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.unpacking import (
    FRAME,
    MESSAGE,
    OpenChunk,
    Record,
    Summary,
    Tally,
    parsed,
    read_summary,
    reason_of,
    records,
)
from semmap_log.interop.formats.parsing.foreign_file import open_regular
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.interop.formats.ros.ros_types import (
    DefinitionForm,
    MessageType,
    RosVersion,
    encoded,
    long_name,
    ros_types,
    whole_topic,
)

CHUNK_BYTES = 4 * 2**20
"""A grid in a chunk with those before it costs little more than what changed; but to show one, a
player that jumps there unpacks its chunk."""


@contextmanager
def mcap_bag(path: Path, topics: Sequence[BagTopic]) -> Iterator[_McapBag]:
    """Write the file; it is closed when the block ends well."""
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file, chunk_size=CHUNK_BYTES, enable_data_crcs=True)
        writer.start(profile=PROFILE, library=LIBRARY)
        yield _McapBag(writer, topics)
        writer.finish()


def qos_of(topic: BagTopic) -> str:
    """Return the QoS with which players offer a topic."""
    return offered_qos(TRANSIENT_LOCAL if topic.is_latched else VOLATILE)


class _McapBag:
    ros_version: RosVersion = 2

    def __init__(self, writer: Any, topics: Sequence[BagTopic]) -> None:
        self._writer = writer
        self._types = ros_types(2)
        self._channels = {topic: self._channel(topic) for topic in topics}
        self._counts: Counter[BagTopic] = Counter()

    def write(self, topic: BagTopic, at_ns: int, message: Any) -> None:
        self.write_encoded(topic, at_ns, encoded(2, message, topic.ros_type))

    def write_encoded(self, topic: BagTopic, at_ns: int, data: bytes) -> None:
        self._writer.add_message(
            self._channels[topic],
            log_time=at_ns,
            data=data,
            publish_time=at_ns,
            sequence=self._counts[topic],
        )
        self._counts[topic] += 1

    def _channel(self, topic: BagTopic) -> int:
        text, _ = self._types.generate_msgdef(topic.ros_type, ros_version=2)
        schema = self._writer.register_schema(topic.ros_type, "ros2msg", text.encode())
        channel: int = self._writer.register_channel(
            topic.name,
            "cdr",
            schema,
            {
                "offered_qos_profiles": qos_of(topic),
                "topic_type_hash": self._types.hash_rihs01(topic.ros_type),
            },
        )
        return channel


FOOTER_BYTES = 37
FOOTER_OPCODE = 2
_FOOTER = Struct("<BQQQI")
"""Opcode, length; where the summary starts (0: there is none), and its offsets; CRC of all that."""
MAGIC = b"\x89MCAP0\r\n"
OUR_TYPES = "semmap_msgs/"

OPEN_BYTES = 384 * 2**20
"""Of a file with an index so much is unpacked at once, where the times of its chunks overlap."""
MESSAGE_BYTES = 200
"""What a message takes in memory besides its data, about."""
MOST_DEFINITION_BYTES = 2**20
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
    """A file that is open."""

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self._path = path
        self._file = file
        with _troubles(path):
            self._footer_at, summary_at = _ends(path, file)
            self._summary = Summary()
            if summary_at:
                self._summary = read_summary(file, summary_at, self._footer_at)
        self._is_indexed = bool(self._summary.chunks)
        is_told = self._is_indexed and self._summary.repeats_channels
        self._channels = self._indexed_channels() if is_told else self._scanned_channels()
        for channel in self._channels.values():
            if channel.message_type.name.startswith(OUR_TYPES):
                raise own_log(path)

    @classmethod
    def open(cls, path: Path, stack: ExitStack) -> McapBag:
        """Open a file, which the stack closes.

        Raises:
            FormatError: It cannot be read, is unfinished, or a segment of a log of ours.
        """
        return cls(path, stack.enter_context(open_regular(path)))

    @property
    def channels(self) -> Collection[BagChannel]:
        """All that hold ROS messages."""
        return list(dict.fromkeys(self._channels.values()))

    def count(self, channels: Collection[BagChannel]) -> int:
        """Return how many messages the summary counts; 0: it has no count."""
        counts = self._summary.counts
        return sum(counts.get(i, 0) for i, each in self._channels.items() if each in channels)

    def messages(self, channels: Collection[BagChannel]) -> Iterator[BagMessage]:
        """Yield the messages of these channels, times ascending."""
        chosen = {i: each for i, each in self._channels.items() if each in channels}
        if not chosen:
            return
        with _troubles(self._path):
            if self._is_indexed:
                ordered = self._indexed_messages(chosen)
            else:
                ordered = in_order(self._scanned_messages(chosen), self._path)
            yield from _counted(ordered, self._expected_count(channels), self._path)

    def _expected_count(self, channels: Collection[BagChannel]) -> int | None:
        """Return how many messages there have to be; None: the summary does not say."""
        return self.count(channels) if self._summary.counts else None

    def _indexed_messages(self, chosen: Mapping[int, BagChannel]) -> Iterator[BagMessage]:
        """Yield the messages of all chunks; few are open at a time, as their times overlap."""
        chunks = [
            (chunk.message_start_time, chunk.chunk_start_offset)
            for chunk in self._summary.chunks
            if not chunk.message_index_offsets or not chosen.keys().isdisjoint(
                chunk.message_index_offsets
            )
        ]  # fmt: skip
        heapq.heapify(chunks)
        heap: list[tuple[int, int, int, int, bytes, OpenChunk, Iterator[Any]]] = []
        tally = Tally(self._footer_at)
        open_bytes = last_ns = 0
        while chunks or heap:
            if chunks and (not heap or chunks[0][0] <= heap[0][0]):
                chunk = self._chunk_at(heapq.heappop(chunks)[1], tally)
                open_bytes += len(chunk.data)
                if open_bytes > OPEN_BYTES:
                    raise FormatError(
                        self._path, "the times of its chunks overlap too far: expected at most "
                        f"{OPEN_BYTES >> 20} MiB to be read at once; rewrite it in order: "
                        "mcap sort",
                    )  # fmt: skip
                messages = chunk.messages(chosen)
            else:
                at_ns, _, _, number, data, chunk, messages = heapq.heappop(heap)
                if at_ns < last_ns:
                    raise ValueError(f"the chunk at byte {chunk.at:,} begins before its index says")
                last_ns = at_ns
                yield BagMessage(chosen[number], at_ns, data)
            following = next(messages, None)
            if following is None:
                open_bytes -= len(chunk.data)
            else:
                at_ns, place, number, data = following
                heapq.heappush(heap, (at_ns, chunk.at, place, number, data, chunk, messages))

    def _chunk_at(self, at: int, tally: Tally) -> OpenChunk:
        from mcap.opcode import Opcode

        record = next(records(self._file, at, self._footer_at, {Opcode.CHUNK}), None)
        if record is None or record.opcode != Opcode.CHUNK:
            raise ValueError(f"expected a chunk at byte {at:,}, as its index says, got none")
        return OpenChunk(record, tally)

    def _indexed_channels(self) -> dict[int, BagChannel]:
        found = {}
        for number, channel in self._summary.channels.items():
            made = _channel(channel, self._summary.schemas.get(channel.schema_id), self._path)
            if made is not None:
                found[number] = made
        return found

    def _scanned_channels(self) -> dict[int, BagChannel]:
        """Return the channels of a file without a summary."""
        from mcap import records as kinds
        from mcap.opcode import Opcode

        schemas: dict[int, Any] = {}
        found: dict[int, BagChannel] = {}
        with _troubles(self._path):
            for record in self._all_records({Opcode.SCHEMA, Opcode.CHANNEL}):
                if record.opcode == Opcode.SCHEMA:
                    schema = parsed(kinds.Schema, record)
                    schemas[schema.id] = schema
                elif record.opcode == Opcode.CHANNEL:
                    channel = parsed(kinds.Channel, record)
                    made = _channel(channel, schemas.get(channel.schema_id), self._path)
                    if made is not None:
                        found[channel.id] = made
        return found

    def _scanned_messages(self, chosen: Mapping[int, BagChannel]) -> Iterator[BagMessage]:
        """Yield the messages in the file's order."""
        from mcap.opcode import Opcode

        for record in self._all_records({Opcode.MESSAGE}):
            if record.opcode == Opcode.MESSAGE:
                if len(record.body) < MESSAGE.size:
                    raise ValueError(f"the message at byte {record.at:,} is cut")
                number, _, at_ns, _ = MESSAGE.unpack_from(record.body)
                if number in chosen:
                    yield BagMessage(chosen[number], at_ns, record.body[MESSAGE.size :])

    def _all_records(self, wanted: Collection[int]) -> Iterator[Record]:
        """Yield the wanted records of the file and of its chunks, to the end of the data.

        Raises:
            ValueError: They are damaged.
        """
        from mcap.opcode import Opcode

        crc = before = crc32(MAGIC)

        def hear(data: bytes) -> None:
            nonlocal crc
            crc = crc32(data, crc)

        asked, tally = {*wanted, Opcode.CHUNK, Opcode.DATA_END}, Tally(self._footer_at)
        for record in records(self._file, len(MAGIC), self._footer_at, asked, hear=hear):
            if record.opcode == Opcode.CHUNK:
                yield from OpenChunk(record, tally).records(wanted)
            elif record.opcode == Opcode.DATA_END:
                (expected,) = unpack_from("<I", record.body)
                if expected not in (0, before):
                    raise ValueError("the CRC of its data is another")
                return
            elif record.opcode in wanted:
                yield record
            before = crc


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
    waiting = last_ns = 0  # bytes, ns
    for number, message in enumerate(messages):
        if message.at_ns < last_ns:
            raise FormatError(
                path,
                "it has no index, and its times go back and forth too far to be read in order; "
                "rewrite it in order: mcap sort",
            )
        heapq.heappush(heap, (message.at_ns, number, message))
        waiting += len(message.data) + MESSAGE_BYTES
        while waiting > REORDERED_BYTES:
            last_ns, _, first = heapq.heappop(heap)
            waiting -= len(first.data) + MESSAGE_BYTES
            yield first
    while heap:
        yield heapq.heappop(heap)[2]


def own_log(path: Path) -> FormatError:
    """Return the error that says that it is no bag but a log of ours."""
    log = path if path.is_dir() else path.parent
    return FormatError(
        path,
        "this is a log of semmap-log, or a part of one, no bag; to take its events into another "
        f"log: {command_line('export', log, 'events.jsonl')}, then import that",
    )


def _channel(channel: Any, schema: Any, path: Path) -> BagChannel | None:
    """Return a channel as we read it; None: its messages are not ROS's.

    Raises:
        FormatError: The text of its type is longer than any.
    """
    version = _ENCODINGS.get(channel.message_encoding)
    if version is None or schema is None:
        return None
    if len(schema.data) > MOST_DEFINITION_BYTES:
        raise FormatError(path, f"topic {shown(channel.topic)}: expected a definition of at most "
                          f"1 MiB, got {len(schema.data):,} bytes")  # fmt: skip
    form = _FORMS.get(schema.encoding, "msg")
    text = schema.data.decode(errors="replace") if schema.encoding in _FORMS else ""
    topic = whole_topic(channel.topic)
    return BagChannel(topic, MessageType(long_name(schema.name), version, text, form))


def _ends(path: Path, file: BinaryIO) -> tuple[int, int]:
    """Return where footer and summary of a closed MCAP begin; the latter is 0 if there is none.

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
    return size - FOOTER_BYTES, _summary_start(path, file, size - FOOTER_BYTES)


def _summary_start(path: Path, file: BinaryIO, footer_at: int) -> int:
    """Return where a summary begins that is as it was written; 0: there is none.

    By a damaged index whole chunks would be passed over in silence.

    Raises:
        FormatError: It is not.
    """
    file.seek(footer_at)
    opcode, length, starts_at, _, expected = _FOOTER.unpack(file.read(_FOOTER.size))
    if (opcode, length) != (FOOTER_OPCODE, FOOTER_BYTES - len(MAGIC) - FRAME.size):
        raise FormatError(path, "damaged: its footer is invalid; repair a copy: mcap recover")
    if starts_at > footer_at:
        raise FormatError(path, f"damaged: expected its summary before byte {footer_at:,}, got "
                          f"byte {starts_at:,}; mend a copy: mcap recover")  # fmt: skip
    if not expected:
        return int(starts_at)  # whoever wrote it left that out
    file.seek(min(starts_at or footer_at, footer_at))
    left, crc = footer_at + _FOOTER.size - 4 - file.tell(), 0
    while left > 0 and (block := file.read(min(left, 2**20))):
        left, crc = left - len(block), crc32(block, crc)
    if crc != expected:
        raise FormatError(path, "damaged: its summary is not as it was written; mend a copy: "
                          "mcap recover")  # fmt: skip
    return int(starts_at)


@contextmanager
def _troubles(path: Path) -> Iterator[None]:
    """Turn whatever the library raises of damaged bytes into our error."""
    try:
        yield
    except FormatError:
        raise
    except Exception as error:
        raise FormatError(
            path, f"damaged: {reason_of(error)}; mend a copy: mcap recover"
        ) from error


@dataclass(frozen=True, slots=True)
class BagTopic:
    """A topic of a bag that is written."""

    name: str
    ros_type: str
    """In ROS 2's long form, such as `nav_msgs/msg/OccupancyGrid`; for ROS 1, too."""
    is_latched: bool
    """Who subscribes late gets the last message: ROS 1's latching, ROS 2's `transient_local`."""


class NewBag(Protocol):
    """A bag while it is written."""

    ros_version: RosVersion
    """Whose message classes it takes: see `ros_types`."""

    def write(self, topic: BagTopic, at_ns: int, message: Any) -> None:
        """Append a message; times do not run backwards."""

    def write_encoded(self, topic: BagTopic, at_ns: int, data: bytes) -> None:
        """Append a message that is bytes already: CDR, or as ROS 1 serializes."""


@dataclass(frozen=True, slots=True)
class BagChannel:
    """A topic of a bag, as one publisher's connection had it."""

    topic: str
    message_type: MessageType


@dataclass(frozen=True, slots=True)
class BagMessage:
    """A message as the bag holds it."""

    channel: BagChannel
    at_ns: int
    """When it was recorded."""
    data: bytes


class BagReader(Protocol):
    """A bag that is open."""

    @property
    def channels(self) -> Collection[BagChannel]:
        """All that it has."""

    def count(self, channels: Collection[BagChannel]) -> int:
        """Return how many messages the bag says that there are."""

    def messages(self, channels: Collection[BagChannel]) -> Iterator[BagMessage]:
        """Yield the messages of these channels, times ascending.

        Raises:
            FormatError: The bag is damaged, or unfinished; or its times go back and forth too far.
        """
