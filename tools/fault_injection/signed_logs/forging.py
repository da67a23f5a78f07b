"""A log's folder as one who has no key sees it: records to change, and hashes to compute again.

Whatever can be made to fit without a key is made to fit: checksums, indexes, summaries, hashes of
commits from some point on, digests in Tombstones, the event that tells of a trimming. The hashes
and digests are computed here, from docs/log_format.md, not by the product.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import semmap_log as sl
from semmap_log.core.messages import read_message, type_name, write_message
from semmap_log.store.chunks import build_chunk
from semmap_log.store.folder import LogFolder
from semmap_log.store.header import SegmentHeader
from semmap_log.store.pages import Page
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import pages_of
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.trimming.trimming import told_of

HEAD = struct.Struct("<BQHIQQ")
"""Of a Message record: opcode, length, channel, sequence, log time, publish time."""
OBSERVED, POSE, COMMIT, NOTE, KEYFRAME, TOMBSTONE = 4, 5, 90, 91, 92, 93
NAMES = {OBSERVED: "DoorObserved", NOTE: "CommitNote", KEYFRAME: "Keyframe", TOMBSTONE: "Tombstone"}
_COMMIT_NUMBERS = struct.Struct("<QQI")
"""In a Commit's CDR bytes, behind the first four: first event, wall clock, count."""


@dataclass
class Record:
    """A Message record."""

    channel: int
    sequence: int
    log_ns: int
    publish_ns: int
    data: bytes

    @classmethod
    def of(cls, record: bytes) -> Record:
        """Return the record of these bytes."""
        _, _, channel, sequence, log_ns, publish_ns = HEAD.unpack_from(record)
        return cls(channel, sequence, log_ns, publish_ns, record[HEAD.size :])

    @property
    def bytes(self) -> bytes:
        """Its bytes."""
        numbers = (self.channel, self.sequence, self.log_ns, self.publish_ns)
        return HEAD.pack(5, HEAD.size - 9 + len(self.data), *numbers) + self.data

    @property
    def said(self) -> dict[str, Any]:
        """Its fields."""
        return dict(read_message(type_name(NAMES[self.channel]), self.data))

    def say(self, **fields: Any) -> None:
        """Change some of its fields."""
        self.data = write_message(type_name(NAMES[self.channel]), self.said | fields)

    @property
    def numbers(self) -> tuple[int, int]:
        """Of a Commit: the number of its first event, and how many it has."""
        first, _, count = _COMMIT_NUMBERS.unpack_from(self.data, 4)
        return first, count

    @property
    def hash(self) -> bytes:
        """Of a Commit."""
        return self.data[-32:]


@dataclass
class Commit:
    """The records of one commit; or a Tombstone of whole commits, or a keyframe, alone."""

    records: list[Record]

    def of(self, channel: int) -> list[Record]:
        """Return its records of a channel."""
        return [one for one in self.records if one.channel == channel]

    @property
    def end(self) -> Record | None:
        """Its Commit record; None: it is a keyframe, or commits that are gone."""
        return self.records[-1] if self.records[-1].channel == COMMIT else None

    @property
    def lacks(self) -> Record | None:
        """The Tombstone of a commit that lacks some of its records."""
        return next(iter(self.of(TOMBSTONE)), None) if self.end else None

    @property
    def gone(self) -> Record | None:
        """The Tombstone of whole commits."""
        return None if self.end else next(iter(self.of(TOMBSTONE)), None)

    def make_fit(self) -> None:
        """Have its Tombstone vouch for what is left now."""
        if self.lacks is not None:
            said = self.lacks.said
            digests = self.digests()
            kept = (digests.get(channel, bytes(32)) for channel in said["channel"].tolist())
            self.lacks.say(kept_digest=b"".join(kept))

    def hash_again(self, before: bytes) -> bytes:
        """Compute its hash behind another commit; return it, or that of the last that is gone."""
        if self.gone is not None:
            self.gone.say(previous_hash=before)
            return bytes(self.gone.said["hash"])
        end = self.end
        if end is None:
            return before
        digests = self.digests()
        if self.lacks is not None:
            said = self.lacks.said
            for i, channel in enumerate(said["channel"].tolist()):
                digests[channel] = bytes(said["digest"][32 * i : 32 * i + 32])
        end.data = end.data[:-64] + before + bytes(32)
        whole = hashlib.sha256(end.bytes[:-32])
        for channel in sorted(digests):
            whole.update(struct.pack("<H", channel) + digests[channel])
        end.data = end.data[:-32] + whole.digest()
        return end.hash

    def digests(self) -> dict[int, bytes]:
        """Return the digest of each channel's records that are there."""
        found: dict[int, Any] = {}
        for one in self.records:
            if one.channel not in (TOMBSTONE, COMMIT):
                found.setdefault(one.channel, hashlib.sha256()).update(one.bytes)
        return {channel: digest.digest() for channel, digest in found.items()}


@dataclass
class SegmentParts:
    """A segment, taken apart."""

    name: str
    header: SegmentHeader
    is_closed: bool
    commits: list[Commit]


class Forgery:
    """A log taken apart, to be put together again with changes."""

    def __init__(self, log: Path) -> None:
        self.log = log
        self.segments = [
            SegmentParts(one.path.name, one.header, one.closed, list(_commits(pages_of(one))))
            for one in LogReader(log).segments
        ]

    @property
    def commits(self) -> list[Commit]:
        """All of them, of all segments."""
        return [commit for segment in self.segments for commit in segment.commits]

    def hash_from(self, start: Commit) -> None:
        """Compute the hashes of all commits from one on, in all segments."""
        before, is_on = bytes(32), False
        for segment in self.segments:
            if is_on:
                segment.header = replace(segment.header, hash_so_far=before)
            for commit in segment.commits:
                is_on |= commit is start
                if is_on:
                    before = commit.hash_again(before)
                elif commit.gone is not None:
                    before = bytes(commit.gone.said["hash"])
                elif commit.end is not None:
                    before = commit.end.hash

    def write(self, *, live: bool = False, tells: bool = True) -> None:
        """Put it in the place of the log; what else knows how far it reached is removed.

        Args:
            live: Whether its last segment shall look like one that is being written.
            tells: Whether an event at its end tells that just this was taken out.
        """
        for pattern in ("*.mcap", "closed-*.json", "metadata.yaml"):
            for file in self.log.glob(pattern):
                file.unlink()
        folder = LogFolder(self.log)
        for segment in self.segments:
            is_last = segment is self.segments[-1]
            _write(folder, segment, is_closed=segment.is_closed and not (is_last and live))
        if tells:
            tell_of_trimming(self.log)


def tell_of_trimming(log: Path) -> None:
    """Have an event at a log's end tell that just that was taken out which is not there."""
    reader = LogReader(log)
    with sl.append(log, compact=False) as opened:
        opened.append([told_of(reader, before=reader.last_event() + 1, rule="nothing to see")])


def _commits(pages: Iterator[Page]) -> Iterator[Commit]:
    records: list[Record] = []
    for page in pages:
        for i in range(len(page.offsets)):
            one = Record.of(bytes(page.record(i)))
            records.append(one)
            is_gone = one.channel == TOMBSTONE and one.said["commits"]
            if one.channel in (COMMIT, KEYFRAME) or is_gone:
                yield Commit(records)
                records = []
    if records:
        yield Commit(records)


def _write(folder: LogFolder, segment: SegmentParts, *, is_closed: bool) -> None:
    """Write a segment: each keyframe in a chunk of its own, all other records between in one."""
    writer = SegmentWriter(folder, segment.name, segment.header)
    try:
        for group in _groups(segment.commits):
            records = [one.bytes for commit in group for one in commit.records]
            ends = np.cumsum([len(one) for one in records])
            page = Page(b"".join(records), segment.header.first_event, writer.path)
            chunk = build_chunk(b"".join(records), np.append(0, ends[:-1]).astype(np.int64))
            next_event = _next_event(group)
            trimmed = {} if segment.header.trimmed is None else {"next_event": next_event}
            writer.add(chunk, levels=page.levels, **trimmed)
        if is_closed:
            writer.close()
        writer.install()
    finally:
        writer.abandon()


def _groups(commits: list[Commit]) -> Iterator[list[Commit]]:
    group: list[Commit] = []
    for commit in commits:
        if commit.records[-1].channel == KEYFRAME:
            if group:
                yield group
            yield [commit]
            group = []
        else:
            group.append(commit)
    if group:
        yield group


def _next_event(group: list[Commit]) -> int:
    last = group[-1].records[-1]
    if last.channel == COMMIT:
        return sum(last.numbers)
    return last.sequence + 1 if last.sequence != 2**32 - 1 else 0
