"""The log that is made from what survives: the same commits, chained anew, whole and closed."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import replace

from semmap_log.core.io.clock import Clock
from semmap_log.core.model.commits import Note
from semmap_log.core.model.events import Event, LogExported
from semmap_log.store.bag_metadata import ClosedSegment, write_bag_metadata
from semmap_log.store.closed_mark import ClosedMark, write_mark
from semmap_log.store.commit_records import CommitBuilder, Stamp
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import FLOOR_MAP_CHANNEL, ROLL_BYTES, ROLL_COMMITS, segment_name
from semmap_log.store.header import SegmentHeader, Trimmed
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.salvage.kept_beginning import KeptBeginning
from semmap_log.store.salvage.rewriting import Rewriter, chunks_of
from semmap_log.store.salvage.trimmed_parts import TrimmedPart
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.trimming.trimming import told_of
from semmap_log.store.verification import GoneCommits, WholeCommit
from semmap_log.store.writing.keyframe_source import (
    KeyframeSource,
    NewKeyframeSource,
    keyframe_chunk,
)

ACTOR = "semmap-log recover"
FORMAT = "semmap-log"


class NewLog:
    """Writes segments into an empty folder; everything is synced once `finish` has returned."""

    def __init__(
        self,
        folder: LogFolder,
        name: str,
        header: SegmentHeader,
        new_source: NewKeyframeSource[KeyframeSource],
        trimmed: Sequence[TrimmedPart] = (),
    ) -> None:
        """Begin a log.

        Args:
            folder: Where it is made.
            name: The name that its folder will have: segments are named after it.
            header: Of its first segment.
            new_source: Makes what knows the state that each of its segments begins with.
            trimmed: Where something was taken out of what survives: each a segment of its own.
        """
        self.rewriter = Rewriter()
        self.folder = folder
        self._name = name
        self._next = header
        self._segment: SegmentWriter | None = None
        self._new_source = new_source
        self._keyframes = new_source(folder, holds_nothing_back)
        self._beginning: KeptBeginning | None = None
        self._closed: list[ClosedSegment] = []
        self._trimmed = {part.first_event: part for part in trimmed}
        self._trimmed_end = max((part.next_event for part in trimmed), default=0)

    def begin_with(self, beginning: KeptBeginning) -> None:
        """Take over the beginning of a log that has a horizon; to be called first."""
        self._beginning = beginning
        self._trimmed_end = max(self._trimmed_end, beginning.next_event)
        writer = beginning.copy_to(self.folder, self._name, self._next.info)
        self._closed.append(writer.closed_segment())
        head, last_ns = writer.written.head, writer.statistics().message_end_time
        self.rewriter.begin_behind(beginning.next_event, head, last_ns)
        self._next = writer.header.next(beginning.next_event, head)
        self._keyframes = self._new_source(self.folder, holds_nothing_back, LogReader(self.folder))

    def add(self, whole: WholeCommit) -> None:
        """Append a commit that survives, if it is not there yet."""
        if self._beginning is not None and whole.commit.last_event < self._beginning.next_event:
            return
        before = self.rewriter.last_ns
        segment = self._segment_for(whole.commit.recorded_ns, before)
        self._write(segment, self.rewriter.rewrite(whole))

    def add_gone(self, gone: GoneCommits) -> None:
        """Append what stands for commits that were taken out, if it is not there yet."""
        if self._beginning is not None and gone.tombstone.first_event < self._beginning.next_event:
            return
        segment = self._segment_for(gone.time_ns, self.rewriter.last_ns)
        self._write(segment, [self.rewriter.go_on_behind(gone)])

    def _write(self, segment: SegmentWriter, records: list[bytes]) -> None:
        for chunk, next_event in chunks_of(records, segment.header.first_event):
            segment.add(chunk, levels=_levels(chunk.facts.counts), next_event=next_event)
            self._keyframes.add(chunk)

    def finish(
        self, source: str, reason: str, clock: Clock, entropy: Callable[[int], bytes] = os.urandom
    ) -> None:
        """Append the commit that says where the log comes from, and close it."""
        now_ns, last_ns = clock.wall_ns(), self.rewriter.last_ns
        recorded_ns = max(now_ns, last_ns + 2)
        segment = self._segment_for(recorded_ns, last_ns)
        first = self.rewriter.numbers.next_event
        stamp = Stamp(
            first_event=first,
            recorded_ns=recorded_ns,
            previous_hash=self.rewriter.head,
            command_id=entropy(16),
            wall_clock_ns=now_ns,
            monotonic_clock_ns=clock.monotonic_ns(),
            boot_id=clock.boot_id,
            durable_before=first,
        )
        note = Note(actor=ACTOR, source=source, reason=reason)
        event = LogExported(format=FORMAT, file_name=source, at_ns=max(last_ns, 0))
        last = CommitBuilder(stamp, note, entropy)
        events: list[Event] = [event]
        if self._trimmed_end:
            rule = "before the log was recovered"
            events.append(told_of(LogReader(self.folder), before=self._trimmed_end, rule=rule))
        for chunk in last.chunks(events):
            segment.add(chunk)
        self._close()
        write_bag_metadata(self.folder, self._closed)
        closed, end = segment.header, last.commit
        mark = ClosedMark(closed.info.log_id, closed.number, end.last_event + 1, end.hash.hex())
        write_mark(self.folder, mark)

    def abandon(self) -> None:
        """Let go of what is being written."""
        if self._segment is not None:
            self._segment.abandon()

    def _segment_for(self, recorded_ns: int, last_ns: int) -> SegmentWriter:
        """Return the segment for a commit; a new one where the last is full, or is trimmed."""
        first, segment = self.rewriter.numbers.next_event, self._segment
        part = self._trimmed.get(first)
        if segment is not None:
            if not _is_full(segment, first) and (part is None or segment.header.trimmed):
                return segment
            self._close()
        header = self._next
        if part is not None:
            header = replace(header, trimmed=Trimmed(part.reasons, part.next_event))
        name = segment_name(self._name, header.number)
        segment = self._segment = SegmentWriter(self.folder, name, header)
        time_ns = min(last_ns + 1, recorded_ns - 1) if last_ns >= 0 else max(0, recorded_ns - 1)
        segment.add(keyframe_chunk(self._keyframes.keyframe(), time_ns), next_event=first)
        return segment

    def _close(self) -> None:
        segment = self._segment
        assert segment is not None
        segment.close()
        segment.install()
        self._closed.append(segment.closed_segment())
        self._next = segment.header.next(self.rewriter.numbers.next_event, self.rewriter.head)
        self._segment = None


def holds_nothing_back() -> None:
    """Do nothing: what a recovery writes is at once with the kernel."""


def _is_full(segment: SegmentWriter, next_event: int) -> bool:
    """Tell whether another segment must begin before an event."""
    trimmed = segment.header.trimmed
    if trimmed is not None:
        return next_event >= trimmed.next_event
    return segment.size >= ROLL_BYTES or segment.commits >= ROLL_COMMITS


def _levels(counts: dict[int, int]) -> set[int]:
    return {channel - FLOOR_MAP_CHANNEL for channel in counts if channel >= FLOOR_MAP_CHANNEL}
