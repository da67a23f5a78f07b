"""A log trimmed: what goes is told by an event before and after, which says who, and why."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Protocol

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.commits import Note
from semmap_log.core.model.events import Event, HistoryTrimmed
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import CorruptLogError, LogError
from semmap_log.log.door_log.opening import WritingOptions, append
from semmap_log.log.replay.read_model.indexing import remove_stale_tables
from semmap_log.log.trimming.copy_check import check_copy
from semmap_log.store.header import TrimReason
from semmap_log.store.kind_bits import bits_of_kinds
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import Window
from semmap_log.store.trimming.records_left import Selection
from semmap_log.store.trimming.trimming import (
    Trimming,
    count_selected,
    of_log,
    takes_anything,
    told_of,
    trim_segments,
)
from semmap_log.store.zip_files import refuse_zip


class TrimRule(Protocol):
    """What is to be taken out of a log."""

    reason: TrimReason

    @property
    def words(self) -> str:
        """What goes, for the log's own history."""
        ...

    @property
    def before(self) -> int:
        """Events below this number, and their notes, may go."""
        ...

    def told_before(self) -> Iterable[Event | EventBatch]:
        """Return what must be in the log before anything goes."""
        ...

    def select(self, segment: Segment) -> Selection | None:
        """Return what goes of a segment; None: nothing."""
        ...


@dataclass(frozen=True, slots=True)
class TrimmedLog:
    """What was taken out of a log now."""

    done: Trimming
    event: int | None
    """Number of the event that tells of it; None: it was only counted."""


def plan_trimming(log: Path, rule: TrimRule, progress: Progress | None = None) -> TrimmedLog:
    """Return what `trim_log` would take out; nothing is written.

    Raises:
        CorruptLogError: A segment is damaged.
        LogError: Some of what is to be redacted lies in a store only; or it is a zip file.
    """
    refuse_zip(log)
    reader = LogReader(log)
    _refuse_elsewhere(reader, rule)
    return TrimmedLog(count_selected(reader, rule.select, progress), None)


def trim_log(
    log: Path,
    rule: TrimRule,
    *,
    note: Note = Note(),
    progress: Progress | None = None,
    writing: WritingOptions | None = None,
) -> TrimmedLog:
    """Take records out of a log for ever, and say so in it; where nothing goes, write nothing.

    Stopped anywhere, the log is whole, and answers as before or as it will; do it again. Each
    trimmed segment is read and verified before it takes the place of the old one.

    Args:
        log: Its folder.
        rule: What goes.
        note: Who does it, and why.
        progress: Told how far the work is.
        writing: Options of `append`, for the events that tell of it.

    Raises:
        LogLockedError: Somebody is writing.
        LogAccessError: The file system says no.
        CorruptLogError: A segment is damaged, or its trimmed copy cannot be verified; it stays as
            it is, and so do those after it.
        LogError: Some of what is to be redacted lies in a store only; or it is a zip file.
    """
    refuse_zip(log)
    reader = LogReader(log)
    _refuse_elsewhere(reader, rule)
    if not takes_anything(reader, rule.select) and not _is_begun(reader):
        return TrimmedLog(Trimming(), None)
    with append(log, **(writing or {})) as opened:
        reader = LogReader(log)
        begun = _told(rule, reader)
        opened.append(
            chain(rule.told_before(), [replace(begun, tombstones=of_log(reader, ""))]), note=note
        )
    try:
        done = trim_segments(log, rule.select, check_copy, progress)
    except CorruptLogError:
        _end(log, rule, note, writing)
        raise
    return TrimmedLog(done, _end(log, rule, note, writing))


def _end(log: Path, rule: TrimRule, note: Note, writing: WritingOptions | None) -> int:
    """Record which records are gone now; return the number of the event that says so."""
    remove_stale_tables(log)
    with append(log, **(writing or {})) as opened:
        return opened.append([_told(rule, LogReader(log))], note=note).commit.last_event


def _refuse_elsewhere(reader: LogReader, rule: TrimRule) -> None:
    """Refuse a redaction of segments whose files were removed from the disk once they were shipped.

    What only grew old may stay there.

    Raises:
        LogError: There are such segments.
    """
    if rule.reason is not TrimReason.REDACTED:
        return
    elsewhere = [one for one in reader.segments if one.told is not None and rule.select(one)]
    if elsewhere:
        fetch = command_line("fetch", "URL", "NEW")
        raise LogError(
            f"{reader.folder}: {counted(len(elsewhere), 'segment')} that may hold it lie in a "
            f"store only, from {elsewhere[0].path.name} on; nothing was taken out. Fetch the whole "
            f"log ({fetch}), redact that, ship it to a new place, and remove the old one."
        )


def _is_begun(reader: LogReader) -> bool:
    """Tell whether a trimming was stopped before the log could say that it is done."""
    window = Window(kinds=bits_of_kinds([HistoryTrimmed]))
    told = [one.event.tombstones for batch in reader.batches(window) for one in batch
            if isinstance(one.event, HistoryTrimmed)]  # fmt: skip
    mine = [one for one in told if one.startswith(of_log(reader, ""))]
    return bool(mine) and mine[-1] == of_log(reader, "")


def _told(rule: TrimRule, reader: LogReader) -> HistoryTrimmed:
    return told_of(reader, before=rule.before, rule=rule.words, reason=rule.reason)
