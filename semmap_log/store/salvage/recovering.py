"""Recovers a log: into another folder, or in its place with the damaged files kept.

The log that is made from what survives: the same commits, chained anew, whole and closed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from semmap_log.core.io.clock import Clock, SystemClock
from semmap_log.core.io.disk import sync_folder
from semmap_log.core.model.commits import Note
from semmap_log.core.model.events import Event, LogExported
from semmap_log.core.texts import counted
from semmap_log.errors import CorruptLogError, LogAccessError, LogError, LogExistsError
from semmap_log.store.bag_metadata import ClosedSegment, write_bag_metadata
from semmap_log.store.closed_mark import ClosedMark, write_mark
from semmap_log.store.commit_records import CommitBuilder, Stamp
from semmap_log.store.folder import LogFolder, refuse_zip
from semmap_log.store.form import (
    FLOOR_MAP_CHANNEL,
    NO_HASH,
    RECOVERING_NAME,
    ROLL_BYTES,
    ROLL_COMMITS,
    segment_name,
)
from semmap_log.store.header import LogInfo, SegmentHeader, Trimmed
from semmap_log.store.lock import WriterLock
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.salvage.recovery_plan import (
    KeptBeginning,
    Loss,
    RecoveryPlan,
    TrimmedPart,
    plan_recovery,
)
from semmap_log.store.salvage.rewriting import Rewriter, chunks_of
from semmap_log.store.salvage.swap import new_folder_beside, put_away, take_place
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.trimming.trimming import told_of
from semmap_log.store.verification import GoneCommits, Progress, Verifier, WholeCommit, verify
from semmap_log.store.verification.file_place import DiskPlace
from semmap_log.store.verification.findings import arrange
from semmap_log.store.verification.keyframe_place import NewKeyframeCheck
from semmap_log.store.writing.keyframe_source import (
    KeyframeSource,
    NewKeyframeSource,
    keyframe_chunk,
)

MOST_NAMED = 20
"""Losses that the note of the new log's last commit names one by one."""

Entropy = Callable[[int], bytes]


@dataclass(frozen=True, slots=True)
class StateParts:
    """What a recovery is handed in of the state that keyframes hold."""

    new_check: NewKeyframeCheck
    """Compares the keyframes of the damaged log, and of the new one, with their events."""
    new_source: NewKeyframeSource[KeyframeSource]
    """Makes the keyframes of the new log."""


@dataclass(frozen=True, slots=True)
class Recovered:
    """What a recovery did."""

    plan: RecoveryPlan
    log: Path | None
    """The log that is whole now; None: there was nothing to do."""
    kept: Path | None
    """Where the damaged files are now."""


def recover(
    log: Path,
    parts: StateParts,
    *,
    progress: Progress | None = None,
    clock: Clock | None = None,
    entropy: Entropy = os.urandom,
) -> Recovered:
    """Put what is whole of a damaged log in its place; the old files go to `damaged-<n>` in it.

    Where numbers change, the log gets a new id: positions in the old one mean nothing in it.
    On a log without damage nothing is done.

    Args:
        log: Its folder.
        parts: Know the state.
        progress: Told how far the reading of the damaged log is.
        clock: Says when the new log was made.
        entropy: Where ids come from.

    Raises:
        LogLockedError: Somebody is writing.
        LogAccessError: The file system does not let us.
        LogError: There is no log, or what was made of it is not good; nothing is changed then.
    """
    log = log.resolve()
    _check_is_folder(log)
    old = LogFolder.held(log)
    lock = WriterLock(old)
    try:
        kept = put_away(log)
        found = plan_recovery(log, parts.new_check, progress)
        if not found.has_to_do:
            return Recovered(found, log if kept else None, kept)
        header = _header(found, entropy, is_new=not found.keeps_numbers)
        with new_folder_beside(log) as folder:
            made = LogFolder.held(folder)
            new_lock = WriterLock(made)
            try:
                new = NewLog(made, log.name, header, parts.new_source, found.trimmed)
                _write(found, new, parts.new_check, clock or SystemClock(), entropy)
                take_place(log, old)
                kept = put_away(log)
            finally:
                new_lock.release()
    except OSError as error:
        if isinstance(error, LogAccessError):
            raise
        raise LogAccessError(f"{log}: cannot be recovered: {error.strerror}.") from error
    finally:
        lock.release()
    return Recovered(found, log, kept)


def recover_into(
    log: Path,
    target: Path,
    parts: StateParts,
    *,
    progress: Progress | None = None,
    clock: Clock | None = None,
    entropy: Entropy = os.urandom,
) -> Recovered:
    """Make a new log, with an id of its own, of what is whole of a damaged one; that stays.

    Args:
        log: The damaged log's folder.
        target: That of the new one, which is not there yet, or empty.
        parts: As for `recover`.
        progress: As for `recover`.
        clock: As for `recover`.
        entropy: As for `recover`.

    Raises:
        LogExistsError: There is something at the target.
        LogAccessError: The file system does not let us.
        LogError: There is no log, or what was made of it is not good; nothing is changed then.
    """
    target = target.resolve()
    if target.exists() and not (target.is_dir() and LogFolder(target).is_empty()):
        raise LogExistsError(f"{target}: there is something here; a new log wants a new folder.")
    found = plan_recovery(log, parts.new_check, progress)
    if not found.has_to_do:
        return Recovered(found, None, None)
    try:
        with new_folder_beside(target) as folder:
            header = _header(found, entropy, is_new=True)
            made = LogFolder.held(folder)
            new = NewLog(made, target.name, header, parts.new_source, found.trimmed)
            _write(found, new, parts.new_check, clock or SystemClock(), entropy)
            (folder / RECOVERING_NAME).unlink()
            folder.rename(target)
            sync_folder(target.parent)
    except OSError as error:
        if isinstance(error, LogAccessError):
            raise
        raise LogAccessError(f"{target}: cannot be written: {error.strerror}.") from error
    return Recovered(found, target, None)


def loss_in_words(found: RecoveryPlan) -> str:
    """Return what a recovery loses, in a sentence for the log itself."""
    if not found.losses and not found.dropped:
        return "nothing was lost"
    named = [_range(loss) for loss in found.losses[:MOST_NAMED]]
    if len(found.losses) > MOST_NAMED:
        named.append(f"{len(found.losses) - MOST_NAMED} more gaps")
    words = f"lost were events {', '.join(named)}" if named else ""
    if found.dropped:
        numbers = ", ".join(str(number) for number in found.dropped[:MOST_NAMED])
        words += f"{'; ' if words else ''}retractions of lost events were dropped: {numbers}"
    return f"{words} (numbers of the damaged log)"


def _range(loss: Loss) -> str:
    if loss.last_event is None:
        return f"from {loss.first_event} on"
    if loss.first_event == loss.last_event:
        return str(loss.first_event)
    return f"{loss.first_event}..{loss.last_event}"


def _check_is_folder(log: Path) -> None:
    refuse_zip(log)
    if not log.is_dir():
        raise LogError(f"{log}: expected a log's folder.")
    if not arrange(DiskPlace(log)).segments:
        raise LogError(f"{log}: no segment of a semmap log is in this folder.")


def _header(found: RecoveryPlan, entropy: Entropy, *, is_new: bool) -> SegmentHeader:
    """Return the header of the new log's first segment, with a new id where it is another log."""
    old = found.header
    info = LogInfo(entropy(16).hex(), "UTC") if old is None else old.info
    if is_new and old is not None:
        info = replace(info, log_id=entropy(16).hex())
    first = SegmentHeader(info, number=0, first_event=0, hash_so_far=NO_HASH)
    if old is None:
        return first
    return replace(first, minor=old.minor, others=old.others, newer=old.newer)


def _write(
    found: RecoveryPlan, new: NewLog, new_check: NewKeyframeCheck, clock: Clock, entropy: Entropy
) -> None:
    """Write the new log, and verify it before anybody sees it."""
    try:
        if found.beginning is not None:
            new.begin_with(found.beginning)
        verifier = Verifier(
            found.path, new_check, on_commit=new.add, on_gone=new.add_gone, keep_parts=True
        )
        verifier.run()
        source = f"{found.path.name} ({found.verification.log_id})"
        new.finish(source, loss_in_words(found), clock, entropy)
    except BaseException:
        new.abandon()
        raise
    made = verify(new.folder.path, new_check)
    own = 2 if found.trimmed or found.beginning is not None else 1
    if made.exit_code != 0 or made.events != found.events + own:
        first = made.findings[0].text if made.findings else counted(made.events, "event")
        raise CorruptLogError(
            new.folder.path, 0, f"the new log is not good: {first}; the old one is kept"
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
