"""What a copy of a log holds already, and what it lacks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import PurePath

from semmap_log.core.io.byte_source import blocks
from semmap_log.core.texts import command_line
from semmap_log.errors import LogError
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import end_of, head_before
from semmap_log.store.reading.segment_scan import Segment


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
    """Return what there is to do.

    Args:
        source: The log.
        copy: Its copy as it is; None: there is none yet.

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
    """Tell whether all segments of the other's range are in the range of one."""
    ours, theirs = one.header, other.header
    return ours.number <= theirs.number and theirs.last_number <= ours.last_number


def _stands_for(there: Segment, segment: Segment) -> bool:
    """Tell whether a file of the copy need not be replaced: it is the same, or was merged there."""
    if not _holds(there, segment):
        return False
    if is_merged_alone(there, segment):
        return there.closed and end_of(there) >= end_of(segment)
    return segment.told is None and is_same_file(there, segment)


def is_merged_alone(there: Segment, segment: Segment) -> bool:
    """Tell whether a file of the copy holds more segments than that of the log."""
    return _holds(there, segment) and not _holds(segment, there)


def is_same_file(one: Segment, other: Segment) -> bool:
    """Tell whether two files hold the same bytes, from their ends.

    What closes a segment holds the CRC of all before it, and where each chunk lies. A live one is
    the same if it ends with the same commit at the same byte: it only grows.
    """
    if (one.header, one.closed, one.whole_end) != (other.header, other.closed, other.whole_end):
        return False
    if not one.closed:
        return one.head == other.head and end_of(one) == end_of(other)
    return one.size == other.size and all(
        ours == theirs
        for ours, theirs in zip(
            blocks(one.source, one.whole_end, one.size),
            blocks(other.source, other.whole_end, other.size),
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
