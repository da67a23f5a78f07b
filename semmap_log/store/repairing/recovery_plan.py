"""What of a damaged log can be saved, and what is lost: found by reading, nothing is written.

`TrimmedPart` states, in new numbers, where something was taken out of what survives. The head of a
trimmed segment states where it ends, so that must be known before the segment is written.

A damaged log whose oldest events are no longer kept has its beginning taken over whole. From its
horizon on a log rests on the keyframe there, and the events before it have the numbers that the
keyframe knows them by. So the first segment is copied into the new log as it is, with its numbers,
gaps and tombstones; what survives after it follows without gaps.

A commit may be split at the keyframe within it: this repairs what an earlier version's `retain`
broke. Up to version 0.1.0 `retain --keep` could take a keyframe between the chunks of one commit
for the horizon. The events before it were removed, and no reader found the keyframe's place any
more. Here that commit becomes two: one of what is gone, which ends at the keyframe, and one of what
is left. The commits after it are chained to these; every event keeps its number.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from semmap_log.core.io.virtual_logs import check_not_virtual
from semmap_log.core.messages import OBJECT_KINDS, decode, fixed_layout, layout
from semmap_log.core.model.commits import Commit
from semmap_log.core.model.events import KINDS, DoorAdded, DoorEvent, HistoryTrimmed
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import CorruptLogError, ElsewhereError, LogError, NewerLogError
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import (
    CHUNK_BYTES,
    COMMIT_CHANNEL,
    KEYFRAME_CHANNEL,
    NOTE_CHANNEL,
    SEQUENCE_RANGE,
    TOMBSTONE_CHANNEL,
    kind_of_channel,
    segment_name,
)
from semmap_log.store.chunks import build_chunk
from semmap_log.store.commit_records import Stamp, closing_record
from semmap_log.store.folder import LogFolder
from semmap_log.store.gone_commands import Tombstone, read_tombstone
from semmap_log.store.header import LogInfo, SegmentHeader, Trimmed, TrimReason, with_all_of
from semmap_log.store.pages import KEYFRAME_BIT, Page
from semmap_log.store.reading.segment_reading import commit_of, end_of, page_at
from semmap_log.store.reading.segment_scan import Segment, open_segment
from semmap_log.store.records import MESSAGE
from semmap_log.store.removed_part import read_removed_part
from semmap_log.store.repairing.rewriting import Rewriter
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.trimming.remaining_records import KeptRecords
from semmap_log.store.verification import (
    GoneCommits,
    Progress,
    Severity,
    ValidCommit,
    Verification,
    Verifier,
)
from semmap_log.store.verification.file_heads import bytes_of
from semmap_log.store.verification.file_place import Vanished
from semmap_log.store.verification.findings import FolderFiles
from semmap_log.store.verification.keyframe_place import NewKeyframeCheck
from semmap_log.store.verification.pieces import Piece, SegmentWalk
from semmap_log.store.writing.keyframe_source import KeyframeMessage, keyframe_chunk


@dataclass(frozen=True, slots=True)
class Loss:
    """Events that cannot be saved."""

    first_event: int
    last_event: int | None
    """None: it is not known how many followed the last that is whole."""
    after_ns: int | None
    """Log time of the last record before them, or None."""
    before_ns: int | None
    """Log time of the first record after them, or None."""
    files: tuple[str, ...]
    why: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RecoveryPlan:
    """What a recovery would do."""

    path: Path
    verification: Verification
    losses: tuple[Loss, ...]
    doors: tuple[int, ...]
    """Doors that have events which survive, while the one that added them is lost."""
    dropped: tuple[int, ...]
    """Retractions of events that are all lost: dropped as well."""
    commits: int
    """That survive."""
    events: int
    span_ns: tuple[int, int] | None
    """Log times of the first and last event that survive."""
    header: SegmentHeader | None
    """Of the log's first segment, with what later versions have put at any head; None: none of them
    can be read."""
    keeps_numbers: bool
    """Every event that survives keeps its number, and every commit its hash."""
    trimmed: tuple[TrimmedPart, ...] = ()
    """Where something was taken out of what survives, on purpose …"""
    beginning: KeptBeginning | None = None
    """… and what is taken over as it is: the log has a horizon."""

    @property
    def info(self) -> LogInfo | None:
        """What is fixed of the log; None: no head can be read."""
        return None if self.header is None else self.header.info

    @property
    def has_to_do(self) -> bool:
        """Return whether there is damage that the next writer would not repair by itself."""
        return bool(self.verification.of(Severity.DAMAGE))

    @property
    def lost_events(self) -> int | None:
        """How many events are lost; None: it cannot be known."""
        counts = [
            None if loss.last_event is None else loss.last_event - loss.first_event + 1
            for loss in self.losses
        ]
        known = [count for count in counts if count is not None]
        return sum(known) if len(known) == len(counts) else None


def plan_recovery(
    path: Path, new_check: NewKeyframeCheck, progress: Progress | None = None
) -> RecoveryPlan:
    """Read a log and return what a recovery would save and lose.

    Args:
        path: As for `verify`; no zip.
        new_check: As for `verify`.
        progress: As for `verify`.

    Raises:
        ElsewhereError: A part of it lies in a store only.
        NewerLogError: It is damaged, and holds what only a later version can take over.
        LogError: It cannot be read, or is no log; or its horizon is damaged.
    """
    check_not_virtual(path)
    if path.is_dir():
        _check_is_all_here(path)
    taken = _Taken()
    verifier = Verifier(
        path,
        new_check,
        progress=progress,
        on_commit=lambda whole: taken.add(whole, verifier),
        on_gone=lambda gone: taken.add_gone(gone, verifier),
        keep_parts=True,
    )
    try:
        found = verifier.run()
    except Vanished:
        raise LogError(f"{path}: somebody is writing to this log; stop that first.") from None
    beginning = None
    if found.of(Severity.DAMAGE):
        beginning = kept_beginning(verifier.arrangement, found, verifier.trimming)
    if not verifier.arrangement.segments:
        raise LogError("\n".join(f"{f.path}: {f.text}" for f in found.findings))
    if beginning is not None and beginning.is_split:
        taken.take_split(beginning)
    headers = verifier.headers
    is_beyond_us = verifier.has_unknown_changes or (verifier.newer and taken.rewriter.has_moved)
    if is_beyond_us and found.of(Severity.DAMAGE):
        raise NewerLogError(
            f"{path}: damaged, and not to be recovered here: a newer version of semmap-log has "
            f"written {_phrase(verifier.newer)} to it, and only that knows what a new number or "
            "a keyframe must make of them. Nothing was changed; recover with the newer version."
        )
    return RecoveryPlan(
        path=path,
        verification=found,
        losses=tuple(taken.losses(found)),
        doors=tuple(sorted(taken.doors - taken.added)),
        dropped=tuple(taken.rewriter.dropped),
        commits=taken.commits,
        events=taken.events,
        span_ns=taken.span_ns,
        header=with_all_of(headers) if headers else None,
        keeps_numbers=not (taken.rewriter.has_changed or (beginning and beginning.is_split)),
        trimmed=taken.trimmed.found(),
        beginning=beginning,
    )


def _phrase(newer: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {kind}" for kind, count in newer.items())


class _Taken:
    """The commits that survive, counted."""

    def __init__(self) -> None:
        self.rewriter = Rewriter()
        self.commits = self.events = 0
        self.doors: set[int] = set()
        self.added: set[int] = set()
        self.span_ns: tuple[int, int] | None = None
        self._next = self._events_below = 0
        self._gaps: list[tuple[int, int | None, int | None, int | None]] = []
        self.trimmed = TrimmedParts()

    def add(self, whole: ValidCommit, verifier: Verifier) -> None:
        """Take the next commit that is whole; one of the beginning is taken over as it is."""
        commit, below = whole.commit, kept_below(verifier.arrangement)
        self._continue(commit.first_event, commit.last_event + 1, commit.recorded_ns)
        self.span_ns = (self.span_ns or (commit.recorded_ns, 0))[0], commit.closed_ns
        self._note_doors(whole)
        if commit.last_event < below:
            self.commits, self.events = self.commits + 1, self.events + whole.left
            self._events_below += whole.left
            return
        numbers, dropped = self.rewriter.numbers, len(self.rewriter.dropped)
        if numbers.next_event < below:
            self.rewriter.continue_after(below, commit.previous_hash, commit.recorded_ns - 1)
        before = numbers.next_event
        self.commits += bool(self.rewriter.rewrite(whole))
        self.events += whole.left - (len(self.rewriter.dropped) - dropped)
        reasons = TrimReason(0) if whole.lacks is None else whole.lacks.reasons
        self.trimmed.add(verifier.place, before, numbers.next_event, reasons)

    def add_gone(self, gone: GoneCommits, verifier: Verifier) -> None:
        """Take in what stands for commits that were taken out."""
        one, below = gone.tombstone, kept_below(verifier.arrangement)
        self._continue(one.first_event, one.next_event, gone.time_ns)
        if one.first_event < below:
            return
        numbers = self.rewriter.numbers
        if numbers.next_event < below:
            self.rewriter.continue_after(below, one.previous_hash, gone.time_ns)
        before = numbers.next_event
        self.rewriter.rewrite_gone(gone)
        self.trimmed.add(verifier.place, before, numbers.next_event, one.reasons)

    def _continue(self, first_event: int, next_event: int, time_ns: int) -> None:
        """Note which events are lost before what comes next."""
        last_ns = self.span_ns[1] if self.span_ns else None
        if first_event > self._next:
            self._gaps.append((self._next, first_event - 1, last_ns, time_ns))
        self._next = next_event

    def take_split(self, beginning: KeptBeginning) -> None:
        """Count the commit of the beginning that becomes two, which is not whole as it is."""
        self.commits += 2
        self.events += beginning.events - self._events_below
        below = beginning.next_event
        self._gaps = [gap for gap in self._gaps if gap[0] >= below]
        self._next = max(self._next, below)

    def losses(self, found: Verification) -> list[Loss]:
        """Return the gaps, each with what was found wrong there."""
        wrong = [f for f in found.of(Severity.DAMAGE) if f.events is not None]
        behind = [f.events[1] for f in wrong if f.events and f.events[0] >= self._next]
        if behind:
            known = [last for last in behind if last is not None]
            last = max(known) if len(known) == len(behind) else None
            self._gaps.append((self._next, last, self.span_ns[1] if self.span_ns else None, None))
        losses = []
        for first, last, after_ns, before_ns in self._gaps:
            mine = [f for f in wrong if f.events and f.events[0] == first]
            files = tuple(dict.fromkeys(f.path.name for f in mine))
            why = tuple(dict.fromkeys(f.text for f in mine))
            losses.append(Loss(first, last, after_ns, before_ns, files, why))
        return losses

    def _note_doors(self, whole: ValidCommit) -> None:
        """Remember which doors its events are about, and which it adds."""
        for part in whole.parts:
            for channel, _, _, _, start, end in part.piece.messages[part.first : part.last]:
                kind = kind_of_channel(channel)
                if kind is None or kind > len(KINDS) or not issubclass(KINDS[kind - 1], DoorEvent):
                    continue
                data = bytes(part.piece.records[start + MESSAGE.size : end])
                door = _door_id(kind, data)
                self.doors.add(door)
                if kind == DoorAdded.kind:
                    self.added.add(door)


def _door_id(kind: int, data: bytes) -> int:
    if kind in OBJECT_KINDS:
        return int(decode(kind, data, None).door_id)  # type: ignore[attr-defined]
    return int(fixed_layout(kind).unpack(data)["door_id"])


def _check_is_all_here(log: Path) -> None:
    """Refuse a log that is partly in a store only: a rebuilt log would begin elsewhere.

    Raises:
        ElsewhereError: It does.
    """
    part = read_removed_part(LogFolder(log))
    if part is not None:
        fetch = command_line("fetch", part.url, "DIR")
        raise ElsewhereError(
            f"{log}: {counted(len(part.files), 'segment')} of it lie at {part.url} only; fetch "
            f"the log ({fetch}), copy the later .mcap files of this folder into it, and "
            "recover that."
        )


@dataclass(frozen=True, slots=True)
class TrimmedPart:
    """What becomes a trimmed segment of the new log."""

    first_event: int
    next_event: int
    """Number of the first event after it."""
    reasons: TrimReason


class TrimmedParts:
    """Takes the segments of a damaged log in order, and what was taken out of each."""

    def __init__(self) -> None:
        self._found: list[TrimmedPart] = []
        self._place = -1
        """Which segment is under way …"""
        self._first_event = self._next_event = 0
        self._reasons = TrimReason(0)
        """… and why something was taken out of it."""

    def add(self, place: int, first_event: int, next_event: int, reasons: TrimReason) -> None:
        """Take in a commit, or what stands for some.

        Args:
            place: Of its segment.
            first_event: The new number of its first event.
            next_event: The same of the first event after it.
            reasons: Why something of it was taken out; 0: nothing was.
        """
        if place != self._place:
            self._end()
            self._place, self._first_event = place, first_event
        self._next_event = next_event
        self._reasons |= reasons

    def found(self) -> tuple[TrimmedPart, ...]:
        """Return all of them."""
        self._end()
        return tuple(self._found)

    def _end(self) -> None:
        if self._reasons:
            part = TrimmedPart(self._first_event, self._next_event, self._reasons)
            self._found.append(part)
        self._reasons = TrimReason(0)


@dataclass(frozen=True, slots=True)
class KeptBeginning:
    """A first segment that has a horizon, whole."""

    segment: Segment
    trimmed: Trimmed
    state: bytes | None
    """The Keyframe message at the horizon, where that stands at the head of the next segment."""
    is_split: bool = False
    """Whether its horizon lies within a commit, which becomes two: `split_commit`."""

    @property
    def next_event(self) -> int:
        """Number of the first event after it."""
        return end_of(self.segment)

    @property
    def events(self) -> int:
        """How many events it holds."""
        return int(self.segment.spans["events"].sum())

    def copy_to(self, folder: LogFolder, name: str, info: LogInfo) -> SegmentWriter:
        """Write it as the first segment of a new log, closed and installed, with its keyframe.

        Raises:
            CorruptLogError: It is damaged.
            OSError: As the file system says.
        """
        header = replace(self.segment.full_header, info=info)
        writer = SegmentWriter(folder, segment_name(name, header.number), header)
        try:
            for records, next_event in self._parts():
                page = Page(records, header.first_event, writer.path)
                chunk = build_chunk(records, page.offsets, compression="zstd")
                writer.add(chunk, levels=page.levels, next_event=next_event)
            if self.state is not None:
                keyframe = KeyframeMessage(self.next_event - 1, self.state)
                chunk = keyframe_chunk(keyframe, writer.statistics().message_end_time)
                writer.add(chunk, next_event=self.next_event)
            writer.close()
            writer.install()
        except BaseException:
            writer.abandon()
            raise
        return writer

    def _parts(self) -> Iterator[KeptRecords]:
        if self.is_split:
            yield from SplitSegment(self.segment, self.trimmed.horizon).parts()
            return
        for i, next_event in enumerate(self.segment.next_events.tolist()):
            yield KeptRecords(bytes(page_at(self.segment, i).records), next_event)


def kept_below(found: FolderFiles) -> int:
    """Return below which number a log's events are taken over as they are; 0: none is."""
    header = found.segments[0].header if found.segments else None
    trimmed = None if header is None else header.trimmed
    return trimmed.next_event if trimmed is not None and trimmed.horizon else 0


def kept_beginning(
    found: FolderFiles, verified: Verification, told: HistoryTrimmed | None
) -> KeptBeginning | None:
    """Return the beginning of a damaged log that has a horizon; None: it has none.

    Args:
        found: Its files.
        verified: What is wrong with it.
        told: Its last report of what was taken out of it: its first segment may be gone.

    Raises:
        LogError: The beginning itself, or the state at the horizon, is damaged.
    """
    if not kept_below(found) and (told is None or not told.horizon):
        return None
    path = found.segments[0].path
    try:
        segment = open_segment(Path(path))
        trimmed = segment.header.trimmed
        damage = [finding for finding in verified.of(Severity.DAMAGE) if finding.path == path]
        if not damage and trimmed is not None and trimmed.horizon:
            return KeptBeginning(segment, trimmed, _state_after(found, segment, trimmed))
        if [finding.kind for finding in damage] == ["keyframe"] and trimmed is not None:
            SplitSegment(segment, trimmed.horizon)  # raises where that is not what is wrong
            return KeptBeginning(segment, trimmed, None, is_split=True)
    except (LogError, IndexError):
        pass
    raise LogError(
        f"{found.folder}: damaged, and not to be recovered: nothing but the state at its horizon "
        "is left of what was before, and that, or the segment before it, is damaged. Nothing was "
        "changed; put back the damaged files from a copy of the log as it was trimmed."
    )


def _state_after(found: FolderFiles, segment: Segment, trimmed: Trimmed) -> bytes | None:
    """Return the keyframe at the head of the second segment, if the state at the horizon is there.

    Of that segment no more need be whole than the chunk with it.

    Raises:
        IndexError: It is damaged, or is not there.
    """
    is_keyframe = segment.chunks.rows["kinds"] == KEYFRAME_BIT
    if (is_keyframe & (segment.next_events == trimmed.horizon)).any():
        return None
    behind = found.segments[1]
    with bytes_of(found.place, behind) as data:
        walk = SegmentWalk(data, behind.header_end, behind.header)
        first = next((item for item in walk if isinstance(item, Piece)), None)
    if first is None or first.messages[0][0] != KEYFRAME_CHANNEL:
        raise IndexError
    _, sequence, _, _, start, end = first.messages[0]
    if sequence != (trimmed.horizon - 1) % SEQUENCE_RANGE:
        raise IndexError
    return bytes(first.records[start + MESSAGE.size : end])


class SplitSegment:
    """A first segment whose horizon lies within a commit, as it is once that is two commits."""

    def __init__(self, segment: Segment, horizon: int) -> None:
        """Find the commit.

        Raises:
            CorruptLogError: None holds the event at the horizon.
        """
        whole = commit_of(segment, horizon)
        if whole is None or whole.first_event >= horizon:
            raise CorruptLogError(segment.path, None, f"no commit reaches across event {horizon}")
        self._whole = whole
        self._segment = segment
        self._horizon = horizon
        self._head = segment.header.hash_so_far
        self._last_ns = -1
        self._next_event = segment.header.first_event
        self._records: list[tuple[int, bytes]] = []
        """Channel and bytes of the records of the commit under way."""
        self._lacks: Tombstone | None = None
        self._delay_ns = 0
        self._is_split = False
        self._kept: list[bytes] = []
        self._size = 0
        self._ready: list[KeptRecords] = []

    def parts(self) -> Iterator[KeptRecords]:
        """Yield its records, in parts of about a chunk, keyframes by themselves.

        Raises:
            CorruptLogError: The keyframe of the horizon is not there, or a chunk is damaged.
        """
        for chunk in range(len(self._segment.chunks)):
            page = page_at(self._segment, chunk)
            for i, channel in enumerate(page.heads["channel_id"].tolist()):
                self._take(channel, bytes(page.record(i)))
            ready, self._ready = self._ready, []
            yield from ready
        self._flush()
        yield from self._ready
        if not self._is_split:
            problem = f"the keyframe before event {self._horizon}, its horizon, is not there"
            raise CorruptLogError(self._segment.path, None, problem)

    def _take(self, channel: int, record: bytes) -> None:
        if channel == KEYFRAME_CHANNEL:
            self._keyframe(record)
        elif channel == TOMBSTONE_CHANNEL:
            found = read_tombstone(record, self._segment.path)
            if found.commits:
                self._gone(found, _time_of(record))
            else:
                self._lacks = found
        elif channel == COMMIT_CHANNEL:
            self._close(record)
        else:
            self._add(channel, record)

    def _keyframe(self, record: bytes) -> None:
        sequence = mcap.MESSAGE.unpack_from(record)[3]
        if sequence == (self._horizon - 1) % SEQUENCE_RANGE:
            self._end_of_gone()
        elif sequence != (self._next_event - 1) % SEQUENCE_RANGE:
            return  # within a commit, and not needed
        self._flush()
        self._last_ns = max(self._last_ns, _time_of(record))
        self._put(_at(record, self._last_ns))
        self._flush()

    def _add(self, channel: int, record: bytes) -> None:
        time_ns = _time_of(record)
        if not self._records:
            self._delay_ns = max(0, self._last_ns + 1 - time_ns)
        self._last_ns = time_ns + self._delay_ns
        self._records.append((channel, _at(record, self._last_ns)))

    def _gone(self, tombstone: Tombstone, time_ns: int) -> None:
        """Put what stands for whole commits that are gone."""
        self._last_ns = max(self._last_ns, time_ns)
        self._put(replace(tombstone, previous_hash=self._head).record(self._last_ns))
        self._head, self._next_event = tombstone.hash, tombstone.next_event

    def _end_of_gone(self) -> None:
        """Put the first of the two commits: what is left before the keyframe."""
        first, kept = self._whole.first_event, len(self._records)
        count = self._horizon - first
        reasons = TrimReason.EXPIRED
        time_ns = self._whole.recorded_ns + count
        lacks = Tombstone(first, count, 0, count - kept, 0, reasons)
        if kept:
            self._lacks, self._delay_ns = lacks, 0
            command = hashlib.sha256(self._whole.command_id).digest()[:16]
            self._commit(first, count, time_ns, replace(self._whole, command_id=command))
        else:
            its_hash = hashlib.sha256(self._whole.hash).digest()
            whole = replace(lacks, commits=1, previous_hash=self._head, hash=its_hash)
            self._gone(whole, time_ns)
        self._is_split = True

    def _close(self, record: bytes) -> None:
        """Put a commit whose Commit record has come."""
        fields = layout("Commit").unpack(record, mcap.MESSAGE.size)
        first, count = fields["first_event"], fields["count"]
        if self._is_split and first == self._whole.first_event:
            last = first + count
            first, count = self._horizon, last - self._horizon
            kept = sum(channel != NOTE_CHANNEL for channel, _ in self._records)
            lacks = self._lacks
            self._lacks = None
            if lacks is not None and (kept < count or lacks.notes_gone):
                self._lacks = Tombstone(
                    first, count, 0, count - kept, lacks.notes_gone, lacks.reasons
                )
        time_ns = _time_of(record) + self._delay_ns
        self._commit(first, count, time_ns, replace(self._whole, **fields))

    def _commit(self, first: int, count: int, time_ns: int, said: Commit) -> None:
        """Put the records of a commit, chained to the one before."""
        time_ns = max(time_ns, self._last_ns + 1)
        stamp = Stamp.of(said, first, self._head, min(said.durable_before, first))
        record, self._head = closing_record(stamp, first + count, time_ns, self._digests())
        note = [one for channel, one in self._records if channel == NOTE_CHANNEL]
        events = [one for channel, one in self._records if channel != NOTE_CHANNEL]
        lacks = [] if self._lacks is None else [self._lacks.record(time_ns - 1 - len(note))]
        self._put(*events, *lacks, *note, record)
        self._last_ns, self._next_event = time_ns, first + count
        self._records, self._lacks, self._delay_ns = [], None, 0
        if self._size >= CHUNK_BYTES:
            self._flush()

    def _put(self, *records: bytes) -> None:
        self._kept += records
        self._size += sum(map(len, records))

    def _flush(self) -> None:
        if self._kept:
            self._ready.append(KeptRecords(b"".join(self._kept), self._next_event))
            self._kept, self._size = [], 0

    def _digests(self) -> dict[int, bytes]:
        """Return the SHA-256 of each channel's records, of lost ones as the tombstone has it."""
        found: dict[int, Any] = {}
        for channel, record in self._records:
            found.setdefault(channel, hashlib.sha256()).update(record)
        digests = {channel: digest.digest() for channel, digest in found.items()}
        lost = () if self._lacks is None else self._lacks.parts
        return digests | {part.channel: part.digest for part in lost}


def _at(record: bytes, time_ns: int) -> bytes:
    """Return a Message record with another log time; a Keyframe's happened time is the same."""
    opcode, length, channel, sequence, log_ns, publish_ns = mcap.MESSAGE.unpack_from(record)
    if log_ns == time_ns:
        return record
    publish_ns = time_ns if publish_ns == log_ns else publish_ns
    head = mcap.MESSAGE.pack(opcode, length, channel, sequence, time_ns, publish_ns)
    return head + record[mcap.MESSAGE.size :]


def _time_of(record: bytes) -> int:
    time_ns: int = mcap.MESSAGE.unpack_from(record)[4]
    return time_ns
