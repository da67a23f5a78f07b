"""Recovers a log: into another folder, or in its place with the damaged files kept.

The new log is made from what survives: the same commits, chained again, whole and closed. It
replaces the old log at once: readers see the old one or the new one.

    .office.recovering/     the new log is made here, next to `office`, marked by `.recovering`
    exchange                the two folders swap their names in one step (renameat2)
    office/damaged-1/       the old folder moves there; files that are not the log's return
    office/.recovering      removed last

If it is killed before the exchange, the log is unchanged, and the next recovery removes the
unfinished folder. If it is killed after it, the log is the new one, and the next recovery does the
last two steps.
"""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from semmap_log.core.io.clock import Clock, SystemClock
from semmap_log.core.io.disk import TEMPORARY_SUFFIX, sync_folder
from semmap_log.core.io.virtual_logs import check_not_virtual
from semmap_log.core.messages import BAG_METADATA_NAME
from semmap_log.core.model.commits import Note
from semmap_log.core.model.events import Event, LogExported
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import CorruptLogError, LogAccessError, LogError, LogExistsError
from semmap_log.store.bag_metadata import ClosedSegment, write_bag_metadata
from semmap_log.store.byte_layout import (
    FLOOR_MAP_CHANNEL,
    LOCK_NAME,
    NO_HASH,
    RECOVERING_NAME,
    ROLL_BYTES,
    ROLL_COMMITS,
    TORN_SUFFIX,
    is_mark_name,
    segment_name,
)
from semmap_log.store.closed_mark import ClosedMark, write_mark
from semmap_log.store.commit_records import CommitBuilder, Stamp
from semmap_log.store.folder import LogFolder
from semmap_log.store.header import LogInfo, SegmentHeader, Trimmed
from semmap_log.store.lock import WriterLock
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.repairing import recovery_plan
from semmap_log.store.repairing.rewriting import Rewriter, chunks_of
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.trimming.trimming import told_of
from semmap_log.store.verification import GoneCommits, Progress, ValidCommit, Verifier, verify
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

    plan: recovery_plan.RecoveryPlan
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
        progress: Called with the progress of reading the damaged log.
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
        found = recovery_plan.plan_recovery(log, parts.new_check, progress)
        if not found.has_to_do:
            return Recovered(found, log if kept else None, kept)
        header = _header(found, entropy, is_new=not found.keeps_numbers)
        with new_sibling_folder(log) as folder:
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
        raise LogExistsError(f"{target}: exists already; expected a new folder for the log.")
    found = recovery_plan.plan_recovery(log, parts.new_check, progress)
    if not found.has_to_do:
        return Recovered(found, None, None)
    try:
        with new_sibling_folder(target) as folder:
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


def loss_text(found: recovery_plan.RecoveryPlan) -> str:
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


def _range(loss: recovery_plan.Loss) -> str:
    if loss.last_event is None:
        return f"from {loss.first_event} on"
    if loss.first_event == loss.last_event:
        return str(loss.first_event)
    return f"{loss.first_event}..{loss.last_event}"


def _check_is_folder(log: Path) -> None:
    check_not_virtual(log)
    if not log.is_dir():
        raise LogError(f"{log}: expected a log's folder.")
    if not arrange(DiskPlace(log)).segments:
        raise LogError(f"{log}: no segment of a semmap log is in this folder.")


def _header(found: recovery_plan.RecoveryPlan, entropy: Entropy, *, is_new: bool) -> SegmentHeader:
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
    found: recovery_plan.RecoveryPlan,
    new: NewLog,
    new_check: NewKeyframeCheck,
    clock: Clock,
    entropy: Entropy,
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
        new.finish(source, loss_text(found), clock, entropy)
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
        trimmed: Sequence[recovery_plan.TrimmedPart] = (),
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
        self._beginning: recovery_plan.KeptBeginning | None = None
        self._closed: list[ClosedSegment] = []
        self._trimmed = {part.first_event: part for part in trimmed}
        self._trimmed_end = max((part.next_event for part in trimmed), default=0)

    def begin_with(self, beginning: recovery_plan.KeptBeginning) -> None:
        """Take over the beginning of a log that has a horizon; to be called first."""
        self._beginning = beginning
        self._trimmed_end = max(self._trimmed_end, beginning.next_event)
        writer = beginning.copy_to(self.folder, self._name, self._next.info)
        self._closed.append(writer.closed_segment())
        head, last_ns = writer.written.head, writer.statistics().message_end_time
        self.rewriter.continue_after(beginning.next_event, head, last_ns)
        self._next = writer.header.next(beginning.next_event, head)
        self._keyframes = self._new_source(self.folder, holds_nothing_back, LogReader(self.folder))

    def add(self, whole: ValidCommit) -> None:
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
        self._write(segment, [self.rewriter.rewrite_gone(gone)])

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
    """Return whether a new segment must begin before an event."""
    trimmed = segment.header.trimmed
    if trimmed is not None:
        return next_event >= trimmed.next_event
    return segment.size >= ROLL_BYTES or segment.commits >= ROLL_COMMITS


def _levels(counts: dict[int, int]) -> set[int]:
    return {channel - FLOOR_MAP_CHANNEL for channel in counts if channel >= FLOOR_MAP_CHANNEL}


_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


def beside(log: Path) -> Path:
    """Return the folder in which the new log is made."""
    return log.with_name(f".{log.name}.recovering")


@contextmanager
def new_sibling_folder(log: Path) -> Iterator[Path]:
    """Yield an empty, marked folder next to a log's; it is removed if the block fails."""
    folder = beside(log)
    if folder.is_symlink() or folder.exists():
        if folder.is_symlink() or not (folder / RECOVERING_NAME).exists():
            raise LogAccessError(f"{folder}: expected nothing at this place; move it elsewhere.")
        shutil.rmtree(folder)
    try:
        folder.mkdir(parents=True)
        (folder / RECOVERING_NAME).touch()
        yield folder
    except BaseException:
        if (folder / RECOVERING_NAME).exists():
            shutil.rmtree(folder, ignore_errors=True)
        raise


def take_place(log: Path, old: LogFolder) -> None:
    """Put the finished log in the place of `log`, in one step.

    Args:
        log: Its path.
        old: What was read there, and is locked.

    Raises:
        LogAccessError: The file system cannot swap two folders; or another lies there now.
    """
    folder = beside(log)
    if not old.is_at(log):
        raise LogAccessError(f"{log}: was moved away while it was recovered; nothing is changed.")
    shutil.copymode(log, folder)
    sync_folder(folder)
    try:
        _exchange(folder, log)
    except OSError as error:
        raise LogAccessError(
            f"{log}: cannot be swapped with a new folder here: {error.strerror}. "
            f"Recover into another place: {command_line('recover', log, '--out', 'NEW', '--yes')}"
        ) from error
    sync_folder(log.parent)


def put_away(log: Path) -> Path | None:
    """Do what is left of a recovery whose new log is in its place; return where the old one is."""
    if not (log / RECOVERING_NAME).exists():
        return None
    old, kept = beside(log), None
    if old.exists():
        kept = _free_name(log)
        old.rename(kept)
        sync_folder(log)
        sync_folder(log.parent)
    for last in _last_kept(log):
        for path in sorted(last.iterdir()):
            if not _is_of_log(path) and not (log / path.name).exists():
                path.rename(log / path.name)
    (log / RECOVERING_NAME).unlink()
    sync_folder(log)
    return kept


def _last_kept(log: Path) -> list[Path]:
    """Return the folder of the last recovery, whose strangers may still have to come back."""
    kept = [path for path in log.glob("damaged-*") if path.is_dir() and not path.is_symlink()]
    return sorted(kept, key=_number)[-1:]


def _free_name(log: Path) -> Path:
    """Return the name after those of all earlier recoveries."""
    used = [*log.glob("damaged-*"), *beside(log).glob("damaged-*")]
    return log / f"damaged-{1 + max(map(_number, used), default=0)}"


def _number(path: Path) -> int:
    digits = path.name.rpartition("-")[2]
    return int(digits) if digits.isascii() and digits.isdigit() else 0


def _is_of_log(path: Path) -> bool:
    """Return whether a file is the damaged log's own."""
    name = path.name
    return (
        path.suffix == ".mcap"
        or TORN_SUFFIX in name
        or name in (BAG_METADATA_NAME, LOCK_NAME)
        or is_mark_name(name)
        or name.endswith(TEMPORARY_SUFFIX)
    )


def _exchange(one: Path, other: Path) -> None:
    """Swap the names of two folders, in one step."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except AttributeError:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS)) from None
    names = os.fsencode(one), os.fsencode(other)
    if rename(_AT_FDCWD, names[0], _AT_FDCWD, names[1], _RENAME_EXCHANGE):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
