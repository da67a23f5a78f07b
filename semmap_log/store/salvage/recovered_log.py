"""The log that is made from what survives: the same commits, chained anew, whole and closed."""

from __future__ import annotations

import os
from collections.abc import Callable

from semmap_log.domain.commits import Note
from semmap_log.domain.events import Event, LogExported
from semmap_log.io.clock import Clock
from semmap_log.store.bag_metadata import ClosedSegment, write_bag_metadata
from semmap_log.store.closed_mark import ClosedMark, write_mark
from semmap_log.store.commit_records import CommitBuilder, Stamp
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import FLOOR_MAP_CHANNEL, ROLL_BYTES, ROLL_COMMITS, segment_name
from semmap_log.store.header import SegmentHeader
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.salvage.kept_beginning import KeptBeginning
from semmap_log.store.salvage.rewriting import Rewriter, chunks_of
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.verification import WholeCommit
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
    ) -> None:
        """Begin a log.

        Args:
            folder: Where it is made.
            name: The name that its folder will have: segments are named after it.
            header: Of its first segment.
            new_source: Makes what knows the state that each of its segments begins with.
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

    def begin_with(self, beginning: KeptBeginning) -> None:
        """Take over the beginning of a log that has a horizon; to be called first."""
        self._beginning = beginning
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
        records = self.rewriter.rewrite(whole)
        for chunk in chunks_of(records) if records else ():
            segment.add(chunk, levels=_levels(chunk.facts.counts))
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
        if self._beginning is not None:
            events.append(self._beginning.told(self.folder))
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
        """Return the segment for a commit; a new one where the last is full.

        Its keyframe wants a nanosecond of its own between the commits.
        """
        segment = self._segment
        if segment is not None:
            is_full = segment.size >= ROLL_BYTES or segment.commits >= ROLL_COMMITS
            if not is_full or recorded_ns <= last_ns + 1:
                return segment
            self._close()
        header = self._next
        name = segment_name(self._name, header.number)
        segment = self._segment = SegmentWriter(self.folder, name, header)
        time_ns = last_ns + 1 if last_ns >= 0 else max(0, recorded_ns - 1)
        segment.add(keyframe_chunk(self._keyframes.keyframe(), time_ns))
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


def _levels(counts: dict[int, int]) -> set[int]:
    return {channel - FLOOR_MAP_CHANNEL for channel in counts if channel >= FLOOR_MAP_CHANNEL}
