"""Copies a log into another folder, or brings a copy up to date.

    .office_000003.mcap.copied.tmp   what the copy lacks is written, synced and verified first
    office_000003.mcap               then each gets its name, in the order of their events
    closed-3-40000.json              then how far the copy reaches is recorded
    metadata.yaml                    and what it contains, for rosbag2's tools

One state of the log is read: its files are held open from the start, so compaction and merges
do not interfere. If it is killed at any step, the copy is a log, as it was or with some more
segments, and the next run continues.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from semmap_log import errors
from semmap_log.core.io.disk import sync_folder
from semmap_log.core.io.progress import Progress
from semmap_log.core.io.url_path import UrlPath, place_of
from semmap_log.core.io.virtual_logs import check_not_virtual
from semmap_log.core.texts import command_line
from semmap_log.store import byte_layout
from semmap_log.store.bag_metadata import write_bag_metadata
from semmap_log.store.closed_mark import ClosedMark, read_mark, read_named_mark, write_mark
from semmap_log.store.copying import copy_plan
from semmap_log.store.folder import LogFolder
from semmap_log.store.lock import WriterLock
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_folder import check_is_log
from semmap_log.store.reading.segment_reading import end_of, statistics_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.segment_set import check_adjoins
from semmap_log.store.removed_part import (
    RemovedPart,
    read_removed_part,
    write_removed_part,
)
from semmap_log.store.verification.keyframe_place import NewKeyframeCheck


@dataclass(frozen=True, slots=True)
class Copied:
    """What a copying has done."""

    path: Path
    """The copy."""
    log_id: str
    events: int
    """The copy ends before the event of that number."""
    head: bytes
    """Hash of its last commit."""
    segments: int
    """Files that were copied now."""
    bytes: int
    """Of them."""
    kept: int
    """Files that were there already, the same."""
    elsewhere: int
    """Segments that lie in a store only; what is kept of them was copied."""
    left_out: tuple[str, ...]
    """What lies in the log's folder and is no part of it: caches, torn tails, others' files."""
    torn_bytes: int
    """Bytes after the log's last whole commit; not copied."""


def copy_log(
    log: Path,
    target: Path,
    new_check: NewKeyframeCheck,
    *,
    full: bool = False,
    progress: Progress | None = None,
) -> Copied:
    """Copy a log, or bring a copy of it up to date; others may write to it during that.

    Args:
        log: Its folder. Nothing is written there, and no lock is taken.
        target: A folder that is not there yet, or is empty, or an earlier copy of the same log.
        new_check: Makes what compares keyframes with the events.
        full: Read and verify what is there already, too; what is damaged there is copied again.
        progress: Called with the number of bytes copied and verified.

    Raises:
        LogExistsError: Something else lies at the target.
        LogError: Another log lies there, or one that went on by itself; or there is no log.
        LogLockedError: Somebody writes to the copy.
        CorruptLogError: The log is damaged; the copy is as it was.
        OutputError: The copy cannot be written; it holds what it held, or some segments more.
    """
    _check_places(log, target)
    folder = LogFolder(log)
    source = LogReader(folder)
    for before, segment in pairwise(source.segments):
        check_adjoins(segment, before)
    with _copy_at(target) as copy:
        copying = _Copying(copy, folder, source, read_removed_part(folder))
        return copying.run(new_check, full=full, progress=progress)


@dataclass(slots=True)
class _Copying:
    """One copying, the copy locked."""

    copy: LogFolder
    log: LogFolder
    source: LogReader
    """The log as it was when this began."""
    removed: RemovedPart | None
    """What was removed from the log's disk."""

    def run(self, new_check: NewKeyframeCheck, *, full: bool, progress: Progress | None) -> Copied:
        plan = copy_plan.plan_copy(self.source, _opened(self.copy))
        if full:
            self._recheck(plan, new_check)
        staged = [copy_plan.StagedFile(self.copy, *one) for one in plan.missing]
        self._remove_stale_files({one.temporary for one in staged})
        told = _told(progress, 2 * sum(one.size for one in staged))
        for one in staged:
            one.make(new_check, told)
        self._put_removed(plan)
        for one in staged:
            one.put()
        self._end(plan)
        return self._copied(plan, sum(one.size for one in staged))

    def _recheck(self, plan: copy_plan.CopyPlan, new_check: NewKeyframeCheck) -> None:
        """Have copied again what is there and is damaged.

        Raises:
            CorruptLogError: It cannot be replaced: it was merged in the copy alone.
        """
        for segment, there in list(plan.kept):
            problem = copy_plan.problem_in_place(self.copy, there.path.name, new_check)
            if problem and copy_plan.is_merged_alone(there, segment):
                raise errors.CorruptLogError(there.path, None, f"{problem}. Copy into a new folder")
            if problem:
                plan.kept.remove((segment, there))
                plan.missing.append((segment, there.path.name))
        plan.missing.sort(key=lambda one: one[0].header.number)

    def _remove_stale_files(self, staged: set[str]) -> None:
        """Remove what others have left unfinished, but what an earlier copying has written."""
        for name in _names(self.copy):
            if byte_layout.is_temporary(name) and name not in staged:
                self.copy.remove(name)

    def _put_removed(self, plan: copy_plan.CopyPlan) -> None:
        """Copy what is kept of segments that were removed from the log's disk, then their list."""
        if self.removed is None:
            return
        for one in self.removed.segments:
            data = self.log.read_bytes(one.kept_name, one.most_kept_bytes)
            if hashlib.sha256(data).hexdigest() != one.kept_sha256:
                raise errors.CorruptLogError(
                    self.log / one.kept_name, None, "it is not what was written"
                )
            if not self.copy.has(one.kept_name) or data != self.copy.read_bytes(
                one.kept_name, len(data) + 1
            ):
                self.copy.write_atomic(one.kept_name, [data])
        for outdated in plan.outdated:  # else it would stand before segments of the list
            self._go_back_before(outdated)
        write_removed_part(self.copy, self.removed)

    def _go_back_before(self, last: Segment) -> None:
        """Remove the copy's last segment, after the marks that name it."""
        for name in byte_layout.mark_names(_names(self.copy)):
            found = read_named_mark(self.copy, name)
            if found is not None and found.segment >= last.header.number:
                self.copy.remove(name)
        self.copy.sync()
        self.copy.remove(last.path.name)
        self.copy.sync()

    def _end(self, plan: copy_plan.CopyPlan) -> None:
        """Write down how far the copy reaches, and what it holds; remove what lies in others."""
        made = LogReader(self.copy)
        last = made.segments[-1]
        mark = ClosedMark(
            last.header.info.log_id, last.header.last_number, end_of(last), last.head.hex()
        )
        if read_mark(self.copy) != mark:
            write_mark(self.copy, mark)
        closed = [one for one in made.segments if one.closed and one.told is None]
        write_bag_metadata(self.copy, map(statistics_of, closed))
        for name in plan.replaced:
            self.copy.remove(name)
        self.copy.sync()

    def _copied(self, plan: copy_plan.CopyPlan, size: int) -> Copied:
        last = self.source.segments[-1]
        return Copied(
            path=self.copy.path,
            log_id=last.header.info.log_id,
            events=end_of(last),
            head=last.head,
            segments=len(plan.missing),
            bytes=size,
            kept=len(plan.kept),
            elsewhere=sum(one.told is not None for one in self.source.segments),
            left_out=_not_copied(self.log),
            torn_bytes=last.torn_bytes,
        )


def _check_places(log: Path, target: Path) -> None:
    """Check that one is a log on a disk, and the other no part of it.

    Raises:
        LogError: It is a URL, or a join.
        OutputError: The copy would lie in the log's own folder, or is that.
    """
    place = place_of(log)
    if isinstance(place, UrlPath):
        line = command_line("fetch", place, target)
        raise errors.LogError(f"{log}: to bring a shipped log to a disk: {line}")
    check_not_virtual(log)
    if log.is_dir() and log.resolve() in (target.resolve(), *target.resolve().parents):
        raise errors.OutputError(f"{target}: lies in the log's own folder; choose another place.")


@contextmanager
def _copy_at(target: Path) -> Iterator[LogFolder]:
    """Hand out the copy's folder, made if it is not there, and locked.

    Raises:
        LogExistsError: Something else lies there.
        LogLockedError: Somebody writes there.
        OutputError: It cannot be made, or written.
    """
    is_new = not target.exists()
    if not is_new:
        _check_may_be_copy(target)
    try:
        target.mkdir(parents=True, exist_ok=True)
        folder = LogFolder.held(target)
        lock = WriterLock(folder)
        try:
            yield folder
            if is_new:
                sync_folder(target.parent)
        finally:
            lock.release()
    except errors.SemmapError:
        raise  # some are OSErrors, too
    except OSError as error:
        said = error.strerror or error
        raise errors.OutputError(
            f"{target}: could not be written: {said}. Its earlier contents are intact; copy again "
            "to continue from here."
        ) from error
    finally:
        _remove_if_nothing(target, is_new=is_new)


def _remove_if_nothing(target: Path, *, is_new: bool) -> None:
    """Remove the folder that was made for a copy of which nothing was written."""
    if (
        is_new
        and target.is_dir()
        and [path.name for path in target.iterdir()] == [byte_layout.LOCK_NAME]
    ):
        (target / byte_layout.LOCK_NAME).unlink()
        target.rmdir()


def _check_may_be_copy(target: Path) -> None:
    """Check that a folder holds a log, or nothing but what a copying that was killed has left.

    Raises:
        LogExistsError: It holds something else; no lock file is put there.
    """
    folder = LogFolder(target)
    if target.is_dir() and all(map(_is_left_by_copying, _names(folder))):
        return
    try:
        check_is_log(folder)
    except errors.NotALogError:
        raise errors.LogExistsError(
            f"{target}: expected nothing there, or an earlier copy of the log, got something else; "
            "choose another place."
        ) from None


def _is_left_by_copying(name: str) -> bool:
    return (
        byte_layout.is_temporary(name)
        or name in (byte_layout.LOCK_NAME, byte_layout.REMOVED_NAME)
        or name.endswith(byte_layout.KEPT_SUFFIX)
    )


def _names(folder: LogFolder) -> list[str]:
    return [name for name, _ in folder.files()]


def _opened(copy: LogFolder) -> LogReader | None:
    """Return the copy as it is; None: it holds no segment yet."""
    if not any(name.endswith(".mcap") for name in _names(copy)):
        return None
    return LogReader(copy)


def _not_copied(folder: LogFolder) -> tuple[str, ...]:
    return tuple(
        name
        for name in _names(folder)
        if not byte_layout.is_name_of_part(name) and not byte_layout.is_temporary(name)
    )


def _told(progress: Progress | None, total: int) -> copy_plan.Told:
    done = 0

    def told(more: int) -> None:
        nonlocal done
        done += more
        if progress is not None:
            progress(done, total)

    return told


__all__ = ["Copied", "copy_log"]
