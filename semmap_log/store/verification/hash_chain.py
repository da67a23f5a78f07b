"""What holds between the records of a log: event numbers, times, and the hash chain, recomputed.

A commit counts when it is whole: its events follow each other by number and by nanosecond, its
Commit record says so, and the hash that is computed from all of its records is the one it contains.
A problem stays open until the next whole commit (or segment) shows how many events were lost.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from typing import Any

from semmap_log.core.messages import layout, read_message, type_name
from semmap_log.core.model.commits import Commit, Durability, Note
from semmap_log.core.texts import counted
from semmap_log.store import byte_layout
from semmap_log.store.commit_records import commit_hash
from semmap_log.store.gone_commands import Tombstone, TombstoneSum
from semmap_log.store.header import SegmentHeader, Unbound
from semmap_log.store.records import MESSAGE
from semmap_log.store.verification.findings import Finding, Severity
from semmap_log.store.verification.pieces import Message, Piece

Report = Callable[[Finding], None]
_NO_NOTE = Note()

SEQUENCE_RANGE = 2**32


@dataclass(slots=True)
class CommitPart:
    """What a commit has in one chunk."""

    piece: Piece
    first: int
    """Its first message there, by its place in `piece.messages`."""
    last: int
    """The place after its last message."""


@dataclass(slots=True)
class ValidCommit:
    """A commit that is as it was written, and where it lies."""

    commit: Commit
    parts: list[CommitPart]
    """Its events and its note; empty where they were not requested."""
    left: int
    """How many of its events are there."""
    has_note: bool = False
    loose: int = 0
    """How many of them only its Tombstone vouches for."""
    lacks: Tombstone | None = None
    """What stands for the others; None: none was taken out."""


@dataclass(frozen=True, slots=True)
class GoneCommits:
    """Whole commits that were taken out on purpose."""

    tombstone: Tombstone
    time_ns: int
    """Log time of the tombstone."""


OnCommit = Callable[[ValidCommit], None]
OnGone = Callable[[GoneCommits], None]


@dataclass(slots=True)
class _Pending:
    """The records of a commit whose Commit record has not come yet."""

    first_event: int
    count: int = 0
    skipped: int = 0
    """Events that are not there, before the last one that is."""
    last_ns: int = -1
    problem: str = ""
    note: Note = _NO_NOTE
    has_note: bool = False
    digests: dict[int, Any] = field(default_factory=dict)
    parts: list[CommitPart] = field(default_factory=list)
    tombstone: Tombstone | None = None
    """What it lacks."""
    kept: Counter[int] = field(default_factory=Counter)
    """Channel -> records of it that are left, in a trimmed segment."""

    @property
    def next_event(self) -> int:
        """Number of the event that must come next."""
        return self.first_event + self.count + self.skipped

    def add(self, channel: int, record: bytes | memoryview, log_ns: int, gap: int = 0) -> None:
        """Take a record in; within a commit each is one nanosecond later than the one before.

        Args:
            channel: Its channel.
            record: All of it.
            log_ns: Its log time.
            gap: So many records that are gone were before it.
        """
        if self.last_ns >= 0 and log_ns != self.last_ns + 1 + gap:
            self.wrong(f"a record of {log_ns} ns follows one of {self.last_ns} ns")
        self.last_ns = log_ns
        digest = self.digests.get(channel)
        if digest is None:
            digest = self.digests[channel] = hashlib.sha256()
        digest.update(record)

    def keep(self, piece: Piece, i: int) -> None:
        """Remember where its records are."""
        if not self.parts or self.parts[-1].piece is not piece:
            self.parts.append(CommitPart(piece, i, i))
        self.parts[-1].last = i + 1

    def wrong(self, problem: str) -> None:
        """Remember the first thing that is wrong with it."""
        self.problem = self.problem or problem


class Chain:
    """Takes chunk after chunk of a log, in order, and reports what does not follow."""

    def __init__(
        self,
        report: Report,
        on_commit: OnCommit | None = None,
        *,
        on_gone: OnGone | None = None,
        keep_parts: bool = False,
    ) -> None:
        """Begin before the first segment.

        Args:
            report: Takes each finding.
            on_commit: Takes each commit that is whole and in its place.
            on_gone: Takes what stands for whole commits that were taken out, in its place.
            keep_parts: Whether commits keep the places of their records.
        """
        self.next_event = 0
        self.head = byte_layout.NO_HASH
        self.commits = 0
        self.events = 0
        self.last_ns = -1
        self.last_seen = -1
        """The greatest event number seen in a chunk that was whole, whatever came of it."""
        self.breaks = 0
        """How often something was wrong with it."""
        self.taken_out = TombstoneSum()
        self.unbound = Unbound()
        self._records = 0
        """Events and notes that are left, so far."""
        self._loose = 0
        """Of them, those that the hash of the last commit does not bind."""
        self._is_trimmed = False
        self._report = report
        self._on_commit = on_commit
        self._on_gone = on_gone
        self._keep_parts = keep_parts
        self._pending: _Pending | None = None
        self._open: list[Finding] = []
        self._path = PurePath()

    def start_at(self, header: SegmentHeader) -> None:
        """Begin in the middle of a log, as the first segment's header says."""
        self.next_event, self.head = header.first_event, header.hash_so_far
        self.last_seen = header.first_event - 1

    def begin_segment(self, path: PurePath, header: SegmentHeader | None) -> None:
        """Go on in the next segment; None: its header cannot be read, so it may be trimmed."""
        self._path = path
        self._is_trimmed = header is None or header.trimmed is not None
        if header is None:
            return
        self.unbound.begin_segment(header)
        if self._pending is not None:
            self.wrong("commit", path, None, "the segment before ends in the middle of a commit")
        if header.first_event > self.next_event:
            if not self._open:
                problem = f"expected event {self.next_event} next, its header says "
                self.wrong("missing", path, None, f"{problem}{header.first_event}")
            self._settle(header.first_event)
            self.head = header.hash_so_far
        elif header.first_event < self.next_event:
            self._report(
                _damage(
                    "header",
                    path,
                    f"its header says that it begins at event {header.first_event}, but "
                    f"event {self.next_event} is the next",
                )
            )
        elif header.hash_so_far != self.head:
            self.wrong(
                "chain",
                path,
                None,
                f"its header says that the commit before has the hash "
                f"{header.hash_so_far.hex()[:16]}…, that one's is {self.head.hex()[:16]}…: "
                "it does not follow that segment, or commits between them were cut off",
            )
            self.head = header.hash_so_far
            self._settle(header.first_event)

    def wrong(self, kind: str, path: PurePath, offset: int | None, text: str) -> None:
        """Note damage; which events it cost shows when whole commits come again."""
        self.breaks += 1
        self._open.append(Finding(kind, Severity.DAMAGE, path, offset, None, text))
        self._pending = None

    def add(self, piece: Piece) -> None:
        """Take the next chunk."""
        self._check_times(piece)
        records = piece.records
        for i, message in enumerate(piece.messages):
            channel, _, _, _, start, end = message
            if channel == byte_layout.KEYFRAME_CHANNEL:
                self._keyframe(piece, message)
            elif channel == byte_layout.TOMBSTONE_CHANNEL and self._is_trimmed:
                self._tombstone(piece, records[start:end], message[2])
            elif channel == byte_layout.COMMIT_CHANNEL:
                self._commit(piece, i, records[start:end])
            else:
                self._add_to_commit(piece, i, records[start:end])

    def end(self, *, last_known: int | None = None) -> None:
        """Report what is still open: nothing follows that would show what was lost."""
        first = self.next_event
        last = max(self.last_seen, last_known if last_known is not None else -1)
        lost = (first, last if last >= first else None)
        for finding in self._open:
            self._report(replace(finding, events=lost))
        self._open = []

    @property
    def unvouched(self) -> int:
        """How many records so far the hash of the last commit does not bind."""
        return self._loose + self.unbound.keyframes

    def forget_unfinished(self) -> int:
        """Leave out the commit that was begun; return how many events of it have come."""
        count = 0 if self._pending is None else self._pending.count
        self._pending = None
        return count

    def number_of(self, sequence: int) -> int:
        """Return the event number with these low 32 bits that is nearest to the next one."""
        half = SEQUENCE_RANGE // 2
        ahead = (sequence - self.next_event + half) % SEQUENCE_RANGE - half
        return self.next_event + ahead

    def _check_times(self, piece: Piece) -> None:
        last = self.last_ns
        is_rising = True
        for channel, _, time, *_ in piece.messages:
            may_repeat = channel in (byte_layout.KEYFRAME_CHANNEL, byte_layout.TOMBSTONE_CHANNEL)
            is_rising &= time > last or (time == last and may_repeat)
            last = time
        if not is_rising:
            problem = f"its log times do not rise from {self.last_ns} ns on"
            self._report(_damage("time", self._path, problem, piece.stored.offset))
        self.last_ns = max(self.last_ns, *(message[2] for message in piece.messages))

    def _keyframe(self, piece: Piece, message: Message) -> None:
        self.unbound.add_keyframe(piece.records[message[4] : message[5]])
        pending = self._pending
        behind = self.next_event if pending is None else pending.next_event
        is_here = (message[1] - behind + 1) % SEQUENCE_RANGE == 0
        if not self._open and not (is_here and message[2] == message[3]):
            problem = f"a keyframe of another event than event {behind - 1}, which it follows"
            self.wrong("keyframe", self._path, piece.stored.offset, problem)

    def _add_to_commit(self, piece: Piece, i: int, record: bytes | memoryview) -> None:
        channel, sequence, log_ns, publish_ns, *_ = piece.messages[i]
        pending = self._pending
        if pending is None:
            pending = self._pending = self._begun(sequence)
        if self._keep_parts:
            pending.keep(piece, i)
        gap = self._gap(pending, channel, sequence)
        pending.skipped += gap
        pending.add(channel, record, log_ns, gap)
        if self._is_trimmed:
            pending.kept[channel] += 1
        expected = pending.next_event
        if channel == byte_layout.NOTE_CHANNEL:
            pending.note = self._note(pending, record)
            if (sequence - expected + 1) % SEQUENCE_RANGE or log_ns != publish_ns:
                pending.wrong("a note that is not of its last event")
        elif byte_layout.kind_of_channel(channel) is None:
            pending.wrong(f"a message on the unknown channel {channel}")
        elif (sequence - expected) % SEQUENCE_RANGE:
            pending.wrong(f"expected event {expected}, got one with the sequence {sequence}")
        elif pending.has_note:
            pending.wrong("an event after the commit's note")
        else:
            pending.count += 1
            self.last_seen = max(self.last_seen, expected)

    def _begun(self, sequence: int) -> _Pending:
        """Return the commit that begins with the event of that sequence."""
        number = self.number_of(sequence)
        is_after_gap = self._is_trimmed and not self._open and number > self.next_event
        return _Pending(self.next_event if is_after_gap else number)

    def _gap(self, pending: _Pending, channel: int, sequence: int) -> int:
        """Return how many events are not there before a record of a trimmed segment."""
        if not self._is_trimmed:
            return 0
        expected = pending.next_event - (
            channel in (byte_layout.NOTE_CHANNEL, byte_layout.COMMIT_CHANNEL)
        )
        return max(0, self.number_of(sequence) - expected)

    def _tombstone(self, piece: Piece, record: bytes | memoryview, time_ns: int) -> None:
        """Take what stands for records that are gone: whole commits, or some of the next."""
        try:
            found = Tombstone.in_record(record)
            found.check()
        except ValueError as error:
            self.wrong("tombstone", self._path, piece.stored.offset, str(error))
            return
        self.taken_out.add(found, record)
        self.unbound.add_tombstone(record, found.next_event)
        if not found.commits:
            self._pending = self._pending or _Pending(found.first_event)
            self._pending.tombstone = found
        elif self._pending is not None:
            self.wrong("tombstone", self._path, piece.stored.offset, "it is within a commit")
        else:
            self._whole_commits(GoneCommits(found, time_ns), piece.stored.offset)

    def _whole_commits(self, commits: GoneCommits, offset: int) -> None:
        """Continue after commits that are gone."""
        gone = commits.tombstone
        told = (gone.first_event, gone.previous_hash)
        if not self._open and told != (self.next_event, self.head):
            problem = (
                f"expected commits from event {self.next_event} on that follow "
                f"{self.head.hex()[:16]}…, got those from {gone.first_event} on that follow "
                f"{gone.previous_hash.hex()[:16]}…"
            )
            self.wrong("tombstone", self._path, offset, problem)
        if gone.first_event < self.next_event:
            return  # events that have come already
        self._settle(gone.first_event)
        self.next_event, self.head = gone.next_event, gone.hash
        self.last_seen = max(self.last_seen, gone.next_event - 1)
        self._loose = self._records  # nothing but the Tombstone says which commits were before it
        if self._on_gone is not None:
            self._on_gone(commits)

    def _note(self, pending: _Pending, record: bytes | memoryview) -> Note:
        if pending.has_note:
            pending.wrong("two notes")
        pending.has_note = True
        try:
            said = read_message(type_name("CommitNote"), record[MESSAGE.size :])
            return Note(**(said | {"salt": bytes(said["salt"])}))
        except ValueError as error:
            pending.wrong(f"its note: {error}")
            return Note()

    def _commit(self, piece: Piece, i: int, record: bytes | memoryview) -> None:
        pending = self._pending or _Pending(self.next_event)
        begun, offset = self._pending is not None, piece.stored.offset
        self._pending = None
        _, sequence, log_ns, publish_ns, *_ = piece.messages[i]
        pending.skipped += (gap := self._gap(pending, byte_layout.COMMIT_CHANNEL, sequence))
        digests = _digests_as_written(pending)
        pending.add(byte_layout.COMMIT_CHANNEL, record, log_ns, gap)
        said = _fields_of(record)
        if said is None:
            self.wrong("commit", self._path, offset, "a Commit record that cannot be read")
            return
        first, count = said["first_event"], said["count"]
        self.last_seen = max(self.last_seen, min(first + count, 2**63) - 1)
        gone = 0 if pending.tombstone is None else pending.tombstone.events_gone
        if pending.tombstone is not None:
            told = (pending.tombstone.first_event, pending.tombstone.count)
            if told != (first, count):
                pending.wrong("its tombstone is of other events")
        lacking = {part.channel for part in pending.tombstone.parts} if pending.tombstone else set()
        is_blank = not pending.note and pending.note.salt == bytes(16)
        if byte_layout.NOTE_CHANNEL in lacking and not is_blank:
            pending.wrong("its note was taken out, and words are there")
        if (first, count) != (pending.first_event, pending.count + gone) or pending.skipped != gone:
            got = f"{pending.count} from {pending.first_event} on"
            has = counted(count, "event")
            pending.wrong(f"the commit has {has} from {first} on, but {got} are here")
        if not count:
            pending.wrong("a commit without events")
        if (sequence - first - count + 1) % SEQUENCE_RANGE or log_ns != publish_ns:
            pending.wrong("its Commit record lacks its last event's number and time")
        if commit_hash(record, digests) != bytes(record[-byte_layout.HASH_BYTES :]):
            pending.wrong("its hash is not that of its records")
        if said["durable_before"] > first:
            pending.wrong("it calls events durable that come after it")
        if pending.problem:
            is_rest = self._open and (not begun or pending.first_event > first)
            if not is_rest:  # of a commit whose beginning is known to be lost
                self.wrong("commit", self._path, offset, pending.problem)
            return
        has_note = pending.has_note
        commit = Commit(
            recorded_ns=log_ns - count - has_note, closed_ns=log_ns, note=pending.note, **said
        )
        loose = sum(
            pending.kept[channel] for channel in lacking if channel != byte_layout.NOTE_CHANNEL
        )
        whole = ValidCommit(
            commit, pending.parts, pending.count, has_note, loose, pending.tombstone
        )
        self._place(whole, offset)

    def _place(self, whole: ValidCommit, offset: int) -> None:
        """Put a whole commit after the last one, if it belongs there."""
        commit = whole.commit
        if commit.first_event < self.next_event:
            last = commit.last_event
            problem = f"events {commit.first_event}..{last} come a second time"
            self._report(_damage("repeated", self._path, problem, offset))
            return
        if commit.first_event > self.next_event and not self._open:
            problem = f"expected event {self.next_event} next, got {commit.first_event}"
            self.wrong("missing", self._path, offset, problem)
        elif commit.first_event == self.next_event and commit.previous_hash != self.head:
            problem = (
                f"the commit of event {commit.first_event} follows one with the hash "
                f"{commit.previous_hash.hex()[:16]}…, but the one before has "
                f"{self.head.hex()[:16]}…"
            )
            self.wrong("chain", self._path, offset, problem)
        self._settle(commit.first_event)
        self.next_event, self.head = commit.last_event + 1, commit.hash
        self.commits += 1
        self.events += whole.left
        self._records += whole.left + whole.has_note
        self._loose += whole.loose
        self.unbound.settle()
        if self._on_commit is not None:
            self._on_commit(whole)

    def _settle(self, next_event: int) -> None:
        """Report what is open, now that it is known which event comes next."""
        lost = (self.next_event, next_event - 1) if next_event > self.next_event else None
        for finding in self._open:
            self._report(replace(finding, events=lost))
        self._open = []
        self.next_event = next_event


def _digests_as_written(pending: _Pending) -> dict[int, bytes]:
    """Return the digest of each channel of a commit, of what is gone by its tombstone."""
    digests = {channel: digest.digest() for channel, digest in pending.digests.items()}
    for part in () if pending.tombstone is None else pending.tombstone.parts:
        if digests.get(part.channel, byte_layout.NO_HASH) != part.kept_digest:
            pending.wrong("what is left of it differs from its tombstone")
        digests[part.channel] = part.digest
    return digests


def _damage(kind: str, path: PurePath, text: str, offset: int | None = None) -> Finding:
    return Finding(kind, Severity.DAMAGE, path, offset, None, text)


def _fields_of(record: bytes | memoryview) -> dict[str, Any] | None:
    """Return the fields of a Commit record; None: it is no such record."""
    commit = layout("Commit")
    if len(record) != MESSAGE.size + commit.dtype.itemsize:
        return None
    said = commit.unpack(record, MESSAGE.size)
    if said["durability"] not in list(Durability):
        return None
    said["durability"] = Durability(said["durability"])
    return said
