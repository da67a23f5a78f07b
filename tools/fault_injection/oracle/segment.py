"""One file of a log, taken apart: what its head says, its commits, and where it ends."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import framing
from cdr import Cdr
from framing import BadBytesError, Message, Record

FLOOR_MAPS, COMMIT, NOTE, KEYFRAME = 100, 90, 91, 92


@dataclass
class Commit:
    """A commit that is whole."""

    fields: dict[str, Any]
    note: dict[str, Any] | None
    events: list[dict[str, Any]]
    recorded_ns: int
    """Log time of its first record."""
    hash: bytes
    """Made anew from its bytes."""


@dataclass
class SegmentFile:
    """What was found in a file."""

    path: Path
    size: int
    head: dict[str, str] = field(default_factory=dict)
    closed: bool = False
    commits: list[Commit] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    """What a crash does not explain."""
    torn_at: int | None = None
    """Where a torn tail begins."""
    schemas: dict[int, tuple[str, str]] = field(default_factory=dict)
    channels: dict[int, tuple[int, str]] = field(default_factory=dict)

    @property
    def number(self) -> int:
        """Its place in the log."""
        return int(self.head["segment"])

    @property
    def last_number(self) -> int:
        """The last of those that were merged into it."""
        return int(self.head["last_segment"])

    @property
    def first_event(self) -> int:
        """Number of its first event, says its head."""
        return int(self.head["first_event"])

    @property
    def next_event(self) -> int:
        """The number behind its last event."""
        if not self.commits:
            return self.first_event
        last = self.commits[-1].fields
        return int(last["first_event"] + last["count"])

    @property
    def hash_at_end(self) -> str:
        """Of its last commit, or of the one before it."""
        return self.commits[-1].hash.hex() if self.commits else self.head["hash_so_far"]


def read_segment(path: Path) -> SegmentFile:
    """Return what is in a file; what is wrong with it stands in `problems`."""
    data = path.read_bytes()
    found = SegmentFile(path, len(data))
    start = _read_head(found, data)
    if start < 0:
        return found
    found.closed = framing.is_closed(data)
    problem = framing.summary_problem(data) if found.closed else ""
    if problem:
        found.problems.append(problem)
    _read_data(found, data, start)
    return found


def _read_head(found: SegmentFile, data: bytes) -> int:
    """Read Header and Metadata; return where the records behind begin, -1 if it has no head."""
    if data[: len(framing.MAGIC)] != framing.MAGIC:
        found.problems.append("not an MCAP file")
        return -1
    both = framing.records(data, len(framing.MAGIC), len(data))
    header, metadata = next(both, None), next(both, None)
    try:
        found.head = _entries(header, metadata)
        _ = found.number, found.last_number, found.first_event, found.head["hash_so_far"]
    except framing.BAD_BYTES as error:
        found.head = {}
        found.problems.append(f"no head that can be read: {error}")
        return -1
    assert metadata is not None
    return metadata.end


def _entries(header: Record | None, metadata: Record | None) -> dict[str, str]:
    """Return what the Metadata `semmap_log` says, which stands behind the Header."""
    if header is None or metadata is None or metadata.opcode != framing.METADATA:
        raise BadBytesError("no head")
    name, at = framing.text(metadata.body, 0)
    if header.opcode != framing.HEADER or name != "semmap_log":
        raise BadBytesError("a head of another program")
    return framing.texts_by_name(metadata.body, at)


def _read_data(found: SegmentFile, data: bytes, start: int) -> None:
    """Read chunks up to the end of the data, or up to the first bytes that do not fit."""
    reading = _Reading(found)
    at, why = start, ""
    for record in framing.records(data, start, len(data)):
        at = record.at
        try:
            is_known = _read_record(found, reading, record)
        except framing.BAD_BYTES as error:
            why = str(error)
            break
        if not is_known:
            break
        at = record.end
    _judge_end(found, reading, data, at, why)


def _read_record(found: SegmentFile, reading: _Reading, record: Record) -> bool:
    """Take in a record; tell whether it is one that stands among the data."""
    if record.opcode == framing.SCHEMA:
        number, name, text = framing.schema(record.body)
        found.schemas[number] = (name, text)
    elif record.opcode == framing.CHANNEL:
        number, schema, topic = framing.channel(record.body)
        found.channels[number] = (schema, topic)
    elif record.opcode == framing.CHUNK:
        reading.take(framing.chunk_messages(record))
    else:
        return record.opcode in (framing.MESSAGE_INDEX, framing.METADATA)
    return True


def _judge_end(found: SegmentFile, reading: _Reading, data: bytes, at: int, why: str) -> None:
    """Tell a torn tail, as a crash leaves it, from damage."""
    if found.closed:
        if why or reading.is_begun:
            found.problems.append(f"byte {at}: {why or 'half a commit'}")
        return
    if at < len(data) or reading.is_begun:
        found.torn_at = at
    known = [
        Cdr(message.data).message(found.schemas[COMMIT][1])["durable_before"]
        for messages in framing.whole_chunks(data, at)
        for message in messages
        if message.channel == COMMIT and COMMIT in found.schemas
    ]
    if known and max(known) > found.next_event:
        found.problems.append(f"byte {at}: {why or 'bytes that do not fit'}; they were durable")


class _Reading:
    """The messages of a file, in order, put together to commits."""

    def __init__(self, found: SegmentFile) -> None:
        self._found = found
        self._time = -1
        self._messages: list[Message] = []
        """Of the commit that has begun."""

    @property
    def is_begun(self) -> bool:
        """Whether there are messages behind the last whole commit."""
        return bool(self._messages)

    def take(self, messages: list[Message]) -> None:
        """Take in a chunk: all of it, or nothing.

        Raises:
            BadBytesError: It does not follow what was there before.
        """
        time, kept, commits = self._time, list(self._messages), list(self._found.commits)
        try:
            for message in messages:
                self._take(message)
        except framing.BAD_BYTES:
            self._time, self._messages, self._found.commits = time, kept, commits
            raise

    def _take(self, message: Message) -> None:
        is_keyframe = message.channel == KEYFRAME
        if message.log_time < self._time + (not is_keyframe):
            raise BadBytesError("a log time that does not grow")
        self._time = message.log_time
        if is_keyframe:
            return
        self._messages.append(message)
        if message.channel == COMMIT:
            self._found.commits.append(self._closed())
            self._messages = []

    def _closed(self) -> Commit:
        """Return the commit that the last message closes, its count, numbers and hash checked."""
        found, (*before, last) = self._found, self._messages
        fields = Cdr(last.data).message(found.schemas[COMMIT][1])
        events, note = [], None
        for message in before:
            schema, topic = found.channels[message.channel]
            values = Cdr(message.data).message(found.schemas[schema][1])
            if message.channel == NOTE:
                note = values
            else:
                events.append(_event(found.next_event + len(events), topic, message, values))
        self._check(fields, before, last, len(events))
        return Commit(fields, note, events, self._messages[0].log_time, bytes(fields["hash"]))

    def _check(
        self, fields: dict[str, Any], before: list[Message], last: Message, count: int
    ) -> None:
        found = self._found
        if (fields["first_event"], fields["count"]) != (found.next_event, count) or not count:
            raise BadBytesError("a commit that does not count its events")
        numbers = [m.sequence for m in before if m.channel != NOTE]
        if numbers != [(found.next_event + i) % 2**32 for i in range(count)]:
            raise BadBytesError("event numbers that do not follow each other")
        if bytes(fields["previous_hash"]).hex() != found.hash_at_end:
            raise BadBytesError("a commit that does not follow the commit before it")
        if bytes(fields["hash"]) != _hash(before, last):
            raise BadBytesError("a commit whose hash is not that of its records")


def _hash(before: list[Message], last: Message) -> bytes:
    """Return what a Commit's last field must be.

    The sha256 of its record without that field, then for each channel, ascending, its id and the
    sha256 of its records in order.
    """
    whole = hashlib.sha256(last.whole[:-32])
    for channel in sorted({message.channel for message in before}):
        records = b"".join(m.whole for m in before if m.channel == channel)
        whole.update(channel.to_bytes(2, "little") + hashlib.sha256(records).digest())
    return whole.digest()


def _event(number: int, topic: str, message: Message, values: dict[str, Any]) -> dict[str, Any]:
    if message.channel >= FLOOR_MAPS:
        kind = "FloorMap"
        digest = hashlib.sha256(bytes(x & 0xFF for x in values["data"])).hexdigest()
        values = {"level": message.channel - FLOOR_MAPS, "cells": digest}
    else:
        kind = "".join(word.capitalize() for word in topic.rsplit("/", 1)[-1].split("_"))
    return {
        "event": number,
        "kind": kind,
        "happened": message.publish_time,
        "recorded": message.log_time,
        **values,
    }
