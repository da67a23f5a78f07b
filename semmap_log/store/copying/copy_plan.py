"""What a copy of a log already contains, and what it lacks.

A segment's copy has a temporary name at first, always the same: it is written, synced, and verified
where it lies. So a copy that was interrupted is found there and continued.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import PurePath

from semmap_log.core.io.byte_source import blocks
from semmap_log.core.io.disk import TEMPORARY_SUFFIX
from semmap_log.core.texts import command_line
from semmap_log.errors import CorruptLogError, LogError
from semmap_log.store.folder import LogFolder
from semmap_log.store.reading.mapped_file import map_file
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import end_of, head_before
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.verification import verify
from semmap_log.store.verification.file_place import DiskFile, DiskPlace
from semmap_log.store.verification.findings import Severity, Verification
from semmap_log.store.verification.keyframe_place import NewKeyframeCheck


@dataclass(slots=True)
class CopyPlan:
    """What there is to do so that a copy holds what a log holds."""

    kept: list[tuple[Segment, Segment]] = field(default_factory=list)
    """Segments of the log that are there already, and what is there of them."""
    missing: list[tuple[Segment, str]] = field(default_factory=list)
    """Segments that are copied, in order, and the name that each gets."""
    replaced: list[str] = field(default_factory=list)
    """Files of the copy whose segments lie in one that is copied under another name."""
    outdated: list[Segment] = field(default_factory=list)
    """Files of the copy that end early, and whose segment lies in a store only by now."""


def plan_copy(source: LogReader, copy: LogReader | None) -> CopyPlan:
    """Return what must be done.

    Args:
        source: The log.
        copy: Its copy as it is, or None.

    Raises:
        LogError: What is there is no earlier state of the log.
    """
    there = [] if copy is None else [one for one in copy.segments if one.told is None]
    if copy is not None:
        check_is_earlier(source, copy)
    plan = CopyPlan()
    for segment in source.segments:
        same = [one for one in there if _overlap(one, segment)]
        standing = next((one for one in same if _stands_for(one, segment)), None)
        if segment.told is not None:  # its file was removed from the log's disk
            plan.outdated += [one for one in same if not one.closed]
        elif standing is not None:
            plan.kept.append((segment, standing))
        else:
            _add_missing(plan, segment, same)
    _check_names(plan, there)
    return plan


def _add_missing(plan: CopyPlan, segment: Segment, there: Sequence[Segment]) -> None:
    """Plan to copy a segment, in place of those of the copy that lie in it."""
    _check_replaceable(segment, there)
    plan.missing.append((segment, (there[0] if there else segment).path.name))
    plan.replaced += [one.path.name for one in there[1:]]


def _check_names(plan: CopyPlan, there: Sequence[Segment]) -> None:
    """Check that no segment is to get a name that another one has.

    Raises:
        LogError: One is: the files of the copy were renamed.
    """
    kept = {one.path.name: one for _, one in plan.kept}
    for segment, name in plan.missing:
        others = [one for one in there if one.path.name == name and not _overlap(one, segment)]
        if name in kept or others:
            raise LogError(
                f"{kept[name].path if name in kept else others[0].path}: expected segment "
                f"{segment.header.number} under this name, as in {segment.path.parent}, got "
                "another one. Give the files of the copy their names back, or copy into a new "
                "folder."
            )


def check_is_earlier(source: LogReader, copy: LogReader) -> None:
    """Check that what lies where a log is copied to is that log, as it was once.

    Raises:
        LogError: It is another log, or it went on by itself.
    """
    where, log = copy.folder, source.folder
    if source.info.log_id != copy.info.log_id:
        raise LogError(
            f"{where}: expected an earlier copy of {log} (log id {source.info.log_id}), got "
            f"another log ({copy.info.log_id}). Nothing was written; choose another folder."
        )
    end, most = end_of(copy.segments[-1]), end_of(source.segments[-1])
    if end > most:
        raise LogError(
            f"{where}: expected an earlier copy of {log}, which ends with event {most - 1}, got "
            f"one that ends with event {end - 1}: somebody has written to it, or {log} is the "
            f"older of the two. Nothing was written. {_what_to_do(log)}"
        )
    if end and source.find_commit(end - 1) is None:
        raise LogError(
            f"{where}: expected an earlier copy of {log}, got one that ends with event {end - 1}, "
            f"which was taken out of {log} since. Nothing was written. Remove the copy, or copy "
            f"into a new folder: {command_line('copy', log, 'NEW')}"
        )
    ours, theirs = head_before(source.segments, end), copy.segments[-1].head
    if ours != theirs:
        expected = "no end of a commit" if ours is None else f"{ours.hex()[:16]}…"
        raise LogError(
            f"{where}: expected an earlier copy of {log}, whose commit before event {end} has the "
            f"hash {expected}, got {theirs.hex()[:16]}…: the two went their own ways. Nothing was "
            f"written. {_what_to_do(log)}"
        )


def _what_to_do(log: PurePath) -> str:
    return f"To keep both, copy into a new folder: {command_line('copy', log, 'NEW')}"


def _overlap(one: Segment, other: Segment) -> bool:
    ours, theirs = one.header, other.header
    return ours.number <= theirs.last_number and theirs.number <= ours.last_number


def _holds(one: Segment, other: Segment) -> bool:
    """Return whether all segments in the other's range are in the range of one."""
    ours, theirs = one.header, other.header
    return ours.number <= theirs.number and theirs.last_number <= ours.last_number


def _stands_for(there: Segment, segment: Segment) -> bool:
    """Return whether a file of the copy may stay: it is the same, or was merged there."""
    if not _holds(there, segment):
        return False
    if is_merged_alone(there, segment):
        return there.closed and end_of(there) >= end_of(segment)
    return segment.told is None and is_same_file(there, segment)


def is_merged_alone(there: Segment, segment: Segment) -> bool:
    """Return whether a file of the copy holds more segments than that of the log."""
    return _holds(there, segment) and not _holds(segment, there)


def is_same_file(one: Segment, other: Segment) -> bool:
    """Return whether two files hold the same bytes, judged by their ends.

    The closing section contains the CRC of all bytes before it and the place of each chunk. A live
    segment is the same if it ends with the same commit at the same byte: it only grows.
    """
    if (one.header, one.closed, one.valid_end) != (other.header, other.closed, other.valid_end):
        return False
    if not one.closed:
        return one.head == other.head and end_of(one) == end_of(other)
    return one.size == other.size and all(
        ours == theirs
        for ours, theirs in zip(
            blocks(one.source, one.valid_end, one.size),
            blocks(other.source, other.valid_end, other.size),
            strict=True,
        )
    )


def _check_replaceable(segment: Segment, there: Sequence[Segment]) -> None:
    """Check that what a segment is to replace lies in it.

    Raises:
        LogError: It does not.
    """
    for one in there:
        if not _holds(segment, one):
            ours, theirs = segment.header, one.header
            problem = (
                f"expected segments out of {ours.number} to {ours.last_number}, which "
                f"{segment.path} holds, got {theirs.number} to {theirs.last_number}: the copy was "
                "compacted by itself"
            )
            raise LogError(f"{one.path}: {problem}. Copy into a new folder.")


Told = Callable[[int], None]
"""Called with how many bytes more are done."""


@dataclass(frozen=True, slots=True)
class StagedFile:
    """A segment of a log, and where its copy is made."""

    folder: LogFolder
    """Of the copy."""
    segment: Segment
    name: str
    """What the copy is to be called."""

    @property
    def size(self) -> int:
        """Bytes that are copied: of a live segment all up to its last whole commit."""
        return self.segment.size if self.segment.closed else self.segment.valid_end

    @property
    def temporary(self) -> str:
        """What it is called until then."""
        return f".{self.name}.copied{TEMPORARY_SUFFIX}"

    def make(self, new_check: NewKeyframeCheck, told: Told) -> None:
        """Write and verify it; what an earlier copying has written is only verified.

        Raises:
            CorruptLogError: The log's own file is damaged; nothing of it is left here.
            OSError: As the system says; nothing of it is left here.
        """
        if self.is_written():
            with suppress(CorruptLogError):
                self.verify(new_check, _nobody)
                told(2 * self.size)
                return
        self.write(told)
        self.verify(new_check, told)

    def is_written(self) -> bool:
        """Return whether an interrupted copy has written it: same length, same closing section."""
        try:
            if self.folder.status(self.temporary).st_size != self.size:
                return False
            there = map_file(self.folder / self.temporary, self.folder)
        except (OSError, LogError):
            return False
        ends = (self.segment.valid_end, self.size) if self.segment.closed else (0, self.size)
        return all(
            ours == theirs
            for ours, theirs in zip(
                blocks(self.segment.source, *ends), blocks(there, *ends), strict=True
            )
        )

    def write(self, told: Told) -> None:
        """Write it, synced.

        Raises:
            CorruptLogError: The log's disk does not give its bytes.
            OSError: As the system says; what was written is removed.
        """
        self.folder.remove(self.temporary)
        fd = self.folder.open(self.temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL)
        try:
            with os.fdopen(fd, "wb") as file:
                for block in blocks(self.segment.source, 0, self.size):
                    file.write(block)
                    told(len(block))
                file.flush()
                os.fsync(fd)
        except BaseException:
            self.folder.remove(self.temporary)
            raise

    def verify(self, new_check: NewKeyframeCheck, told: Told) -> None:
        """Read all of it, and check that it is good, and ends where the log's own segment ends.

        Raises:
            CorruptLogError: It is not: names the log's own file.
        """
        before = 0

        def progress(done: int, _total: int) -> None:
            nonlocal before
            told(done - before)
            before = done

        place = _OneFile(self.folder, self.name, self.temporary)
        found = verify(place, new_check, progress=progress)
        told(self.size - before)
        try:
            self._check(found)
        except CorruptLogError:
            self.folder.remove(self.temporary)
            raise

    def _check(self, found: Verification) -> None:
        segment = self.segment
        wrong = found.of(Severity.DAMAGE, Severity.TORN, Severity.NOT_A_LOG)
        if wrong:
            raise CorruptLogError(segment.path, wrong[0].offset, f"{wrong[0].text}; {_AS_IT_WAS}")
        events = int(segment.spans["events"].sum())
        is_empty = end_of(segment) == segment.header.first_event
        if (found.events, found.head) != (events, found.head if is_empty else segment.head):
            problem = f"expected {events} events up to the hash {segment.head.hex()[:16]}…, got "
            problem += f"{found.events} up to {found.head.hex()[:16]}…; {_AS_IT_WAS}"
            raise CorruptLogError(segment.path, None, problem)

    def put(self) -> None:
        """Give it its name; it survives a power cut.

        Raises:
            OSError: As the system says.
        """
        self.folder.put(self.temporary, self.name)


def _nobody(_more: int) -> None:
    """Report nothing."""


_AS_IT_WAS = "it was not copied, and the copy is as it was"


class _OneFile(DiskPlace):
    """A `FilePlace`: one segment, which lies under another name."""

    def __init__(self, folder: LogFolder, name: str, lies_at: str) -> None:
        super().__init__(folder / name)
        self._folder = folder
        self._lies_at = lies_at

    def is_folder(self) -> bool:
        """Return that it is no folder."""
        return False

    @contextmanager
    def opened(self, file: PurePath) -> Iterator[DiskFile]:
        """Open it; as `FilePlace.opened`."""
        del file
        fd = self._folder.open_to_read(self._lies_at)
        try:
            yield DiskFile(fd)
        finally:
            os.close(fd)


def problem_in_place(folder: LogFolder, name: str, new_check: NewKeyframeCheck) -> str:
    """Read all of a segment that lies in a folder, and return what is wrong; empty: nothing."""
    found = verify(_OneFile(folder, name, name), new_check)
    return found.findings[0].text if found.exit_code else ""
