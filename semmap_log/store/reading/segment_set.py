"""Which files of a folder are the log: all of one, none missing, in the order of their heads.

`SegmentStore` is where a log's segments are: a folder on disk, or another place that returns ranges
of bytes. It states once, for all places, what the reader needs. Writing, recovery and compaction
need a folder: a robot writes to its disk.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import PurePath
from typing import TYPE_CHECKING, Protocol

from semmap_log.core.io.byte_source import ByteSource
from semmap_log.core.model.commits import Commit
from semmap_log.core.texts import command_line
from semmap_log.errors import CorruptLogError
from semmap_log.store.byte_layout import number_in
from semmap_log.store.closed_mark import ClosedMark
from semmap_log.store.reading.segment_reading import commit_of, end_of, head_before, last_commit
from semmap_log.store.reading.segment_scan import Segment

if TYPE_CHECKING:
    from semmap_log.store.manifest import ShippedSegment


@dataclass(frozen=True, slots=True)
class SegmentSet:
    """The segments of a log, by the order of their events."""

    segments: list[Segment]
    leftovers: list[PurePath]
    """Files whose segments were merged into another: no part of the log any more."""


def arrange(folder: PurePath, found: Sequence[Segment]) -> SegmentSet:
    """Return which of the segments found in a folder are the log. File names do not matter.

    Raises:
        CorruptLogError: Names the file at which something is wrong: it is of another log, or
            there twice, or was cut; or the number of the one that is missing.
    """
    _check_one_log(found)
    segments: list[Segment] = []
    leftovers: list[PurePath] = []
    expected = 0
    for segment in sorted(found, key=lambda s: (s.header.number, -s.header.last_number)):
        if segment.header.number < expected:
            _check_covered(segment, segments)
            leftovers.append(segment.path)
            continue
        if segment.header.number > expected:
            raise _missing(folder, segment, expected)
        segments.append(segment)
        expected = segment.header.last_number + 1
    for segment, following in pairwise(segments):
        _check_before(segment, following)
    return SegmentSet(segments, leftovers)


def check_follows(segment: Segment, last: Commit | None, before: Segment) -> None:
    """Check that a segment begins where the one before it ends.

    Args:
        segment: One segment.
        last: The last commit of the segment before it; None: it has none.
        before: That segment.

    Raises:
        CorruptLogError: It does not: one of the two was swapped, or cut.
    """
    next_event = before.header.first_event if last is None else last.last_event + 1
    head = before.header.hash_so_far if last is None else last.hash
    _check_begins(segment, next_event, head, before)


def _check_begins(segment: Segment, next_event: int, head: bytes, before: Segment) -> None:
    if segment.header.first_event != next_event:
        raise CorruptLogError(
            segment.path,
            0,
            f"it begins with event {segment.header.first_event}, but {before.path.name} before it "
            f"ends before event {next_event}; one of the two is not what it was",
        )
    if segment.header.hash_so_far != head:
        raise CorruptLogError(
            segment.path,
            0,
            f"it follows the commit {segment.header.hash_so_far.hex()[:12]}…, but "
            f"{before.path.name} before it ends with {head.hex()[:12]}…; "
            "one of the two is of another copy of this log",
        )


def check_adjoins(segment: Segment, before: Segment) -> None:
    """Check that a segment begins where the one before it ends, by their heads and indexes.

    No chunk is read: for questions that look at a few places of a long log. They rest on all of
    its segments, since one is skipped because of what an index states.

    Raises:
        CorruptLogError: Events are missing between them, one is of another copy of the log, or
            their order is not that of their times.
    """
    _check_begins(segment, end_of(before), before.head, before)
    (_, end_ns), (start_ns, _) = before.recorded, segment.recorded
    if 0 < start_ns <= end_ns:
        problem = f"its first log time {start_ns} is not after the last of {before.path.name}"
        raise CorruptLogError(segment.path, 0, f"{problem}, {end_ns}, which its head says")


def check_reaches(mark: ClosedMark, path: PurePath, segments: Sequence[Segment]) -> None:
    """Check that a log is as long as it was when its last segment was closed.

    Args:
        mark: What was written then.
        path: Where, for messages.
        segments: All of the log, in order.

    Raises:
        CorruptLogError: It ends before, or is another.
    """
    last = segments[-1]
    if mark.log_id != last.header.info.log_id:
        ours = last.header.info.log_id
        raise CorruptLogError(path, None, f"expected the log id {ours}, got {mark.log_id}")
    if last.header.last_number < mark.segment:
        where, problem = path.parent, f"segment {mark.segment}, its last, is missing"
    elif (end := end_of(last)) < mark.next_event:
        where, problem = last.path, f"it ends before event {end}: it was cut, or is an older state"
    elif head_before(segments, mark.next_event) != bytes.fromhex(mark.head):
        problem = f"its commit before event {mark.next_event} is of another copy of this log"
        where = last.path
    else:
        return
    known = f"by {path.name}, the closed segments ended before event {mark.next_event}"
    raise CorruptLogError(where, None, f"{problem}; {known}. {_to_continue(path.parent)}")


def _to_continue(log: PurePath) -> str:
    return f"To continue with what is left: {command_line('recover', log)}"


def check_listed(names: Sequence[str], path: PurePath, segments: Sequence[Segment]) -> None:
    """Check that what metadata.yaml lists is there, and closed; for a log without a mark.

    Args:
        names: The closed segments that it lists.
        path: Where, for messages.
        segments: All of the log, in order.

    Raises:
        CorruptLogError: One was cut, or is missing.
    """
    last, to_continue = segments[-1], _to_continue(path.parent)
    if not last.closed and last.path.name in names:
        problem = (
            f"{path.name} lists it as closed, but no footer ends it: it was cut. {to_continue}"
        )
        raise CorruptLogError(last.path, last.valid_end, problem)
    numbers = [number for name in names if (number := number_in(name)) is not None]
    if numbers and max(numbers) > last.header.last_number:
        problem = (
            f"segment {max(numbers)}, its last, is missing; {path.name} lists it. {to_continue}"
        )
        raise CorruptLogError(path.parent, None, problem)


def check_continues(segments: Sequence[Segment], earlier: Sequence[Segment]) -> None:
    """Check that a log still has what it had at the last look, and what came after.

    Args:
        segments: All of it, in order.
        earlier: The same, as they were.

    Raises:
        CorruptLogError: It ends before, or has another commit where it ended.
    """
    end = end_of(earlier[-1])
    if segments[-1].header.info.log_id != earlier[-1].header.info.log_id:
        return  # another log: its reader says so
    if end and head_before(segments, end) != earlier[-1].head:
        problem = f"the commit before event {end}, which was there before, is not there"
        raise CorruptLogError(
            segments[-1].path, None, f"{problem}: the log was restored or replaced; reopen it"
        )


def _check_one_log(found: Sequence[Segment]) -> None:
    ids = Counter(segment.header.info.log_id for segment in found)
    if len(ids) < 2:
        return
    ours = ids.most_common(1)[0][0]
    foreign = next(s for s in found if s.header.info.log_id != ours)
    raise CorruptLogError(
        foreign.path,
        0,
        f"a segment of another log (id {foreign.header.info.log_id}); "
        f"segments of {len(ids)} logs lie in one folder; most are of the log {ours}",
    )


def _missing(folder: PurePath, segment: Segment, expected: int) -> CorruptLogError:
    last = segment.header.number - 1
    names = f"segment {expected} is" if last == expected else f"segments {expected} to {last} are"
    return CorruptLogError(
        segment.path,
        0,
        f"expected segment {expected} of the log next, got segment {segment.header.number}: "
        f"one is missing; {names} not in {folder}",
    )


def _check_before(segment: Segment, following: Segment) -> None:
    """Check the heads of two neighbours without a look at the data between them."""
    if not segment.closed:
        problem = (
            f"not closed, and {following.path.name} follows it: it was cut; "
            f"events before {following.header.first_event} are affected"
        )
        raise CorruptLogError(segment.path, segment.valid_end, problem)
    if following.header.first_event < segment.header.first_event:
        problem = (
            f"it begins with event {following.header.first_event}, before {segment.path.name} does"
        )
        raise CorruptLogError(following.path, 0, problem)


def _check_covered(segment: Segment, before: Sequence[Segment]) -> None:
    """Check that a segment holds nothing that a merged one does not hold, with the same hashes.

    Raises:
        CorruptLogError: It does.
    """
    header = segment.header
    whole = before[-1]
    for other in before:
        if other.header.number <= header.number <= other.header.last_number:
            whole = other
    merged = (whole.header.number, whole.header.last_number)
    if merged == (header.number, header.last_number):
        raise CorruptLogError(
            segment.path,
            0,
            f"segment {header.number} of the log is there twice; the other is {whole.path.name}",
        )
    if header.last_number > whole.header.last_number:
        raise CorruptLogError(
            segment.path,
            0,
            f"segments {header.number} to {header.last_number}, and {whole.path.name} "
            f"holds {merged[0]} to {merged[1]}: they overlap",
        )
    if not _is_part(segment, whole):
        raise CorruptLogError(
            segment.path,
            0,
            f"its segment {header.number} is a part of {whole.path.name}, "
            "which has other commits there",
        )


def _is_part(segment: Segment, whole: Segment) -> bool:
    """Return whether a larger segment has the same commits before and at the end of this one."""
    header = segment.header
    if header.first_event == whole.header.first_event:
        before = whole.header.hash_so_far
    else:
        commit = commit_of(whole, header.first_event - 1)
        if commit is None or commit.last_event != header.first_event - 1:
            return False
        before = commit.hash
    if before != header.hash_so_far:
        return False
    return _ends_alike(segment, whole)


def _ends_alike(segment: Segment, whole: Segment) -> bool:
    """Return whether a segment's last commit is in a larger segment, too.

    The log does not need what lies in another file, so it need not be whole.
    """
    try:
        last = last_commit(segment)
    except CorruptLogError:
        return True
    if last is None:
        return True
    found = commit_of(whole, last.last_event)
    return found is not None and found.hash == last.hash


Listing = list[tuple[str, Hashable]]
"""The name of each segment file, and what distinguishes it from another file of that name."""


class SegmentStore(Protocol):
    """The files of one log, as a reader sees them. A closed segment never changes under its name.

    It may be queried repeatedly while a writer changes the place.
    """

    @property
    def path(self) -> PurePath:
        """Where the log lies, as it was given: for messages."""

    @property
    def given(self) -> PurePath:
        """The same, whatever becomes of the working directory."""

    def segments(self) -> Listing:
        """Return the segments that are there now, at least one.

        Raises:
            NotALogError: There is no segment.
            LogAccessError: They cannot be listed.
        """

    def open(self, name: str) -> ByteSource:
        """Return a segment's bytes as they are now.

        Raises:
            NotALogError: It is no file.
            LogAccessError: It cannot be read; `FileNotFoundError` is its cause where it has gone.
        """

    def told(self, name: str) -> ShippedSegment | None:
        """Return what a manifest says of a closed segment, so that it need not be opened for it."""

    def size_of(self, name: str) -> int:
        """Return the current size of a segment in bytes: a live one grows.

        Raises:
            OSError: It is gone, or cannot be accessed.
        """

    def mark(self) -> ClosedMark | None:
        """Return how far the log reached when its last segment was closed; None: not known.

        Raises:
            CorruptLogError: What says so is not what was written.
            LogAccessError: It cannot be read.
        """

    def closed_names(self) -> Sequence[str]:
        """Return the segments that are known as closed: needed where there is no mark."""
