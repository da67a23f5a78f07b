"""Trims a log: an event before and one after state what goes, who does it, and why.

A log need not keep old sightings, changes of state and poses any longer. Events that say which
doors, levels, floor plans and rounds there were stay, and so do retracted ones, and the last of
each door that set its state. A keyframe stands at the horizon; from there on all moments can be
queried. The trimmed copy of a segment is checked
before it replaces the segment.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path, PurePath
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.io.byte_source import ByteSource
from semmap_log.core.io.progress import Progress
from semmap_log.core.io.virtual_logs import check_not_virtual
from semmap_log.core.model.commits import Note
from semmap_log.core.model.events import Event, HistoryTrimmed, MomentPinned
from semmap_log.core.model.moments import format_second
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import CorruptLogError, LogError
from semmap_log.log.door_log.opening import WritingOptions, append
from semmap_log.log.replay import keyframes
from semmap_log.log.replay.maintenance import ReplayKeyframeCheck
from semmap_log.log.replay.read_model.indexing import remove_stale_tables
from semmap_log.log.replay.state import (
    keyframe_at,
    pinned_state,
    pins,
    retractions_after,
    state_at,
    state_events,
    with_state,
)
from semmap_log.store.byte_layout import kinds_of
from semmap_log.store.header import TrimReason
from semmap_log.store.pages import EXPIRING, KEYFRAME_BIT, Page, kinds_mask
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import commit_of, end_of
from semmap_log.store.reading.segment_scan import Segment, numbers_of
from semmap_log.store.reading.window import Window
from semmap_log.store.trimming import trimming
from semmap_log.store.trimming.remaining_records import Selection
from semmap_log.store.verification import Severity, Verifier
from semmap_log.store.verification.file_place import DiskPlace, OpenedFile


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

    def recorded_before(self) -> Iterable[Event | EventBatch]:
        """Return what must be in the log before anything goes."""
        ...

    def select(self, segment: Segment) -> Selection | None:
        """Return what goes of a segment; None: nothing."""
        ...


@dataclass(frozen=True, slots=True)
class TrimmedLog:
    """What was taken out of a log now."""

    done: trimming.Trimming
    event: int | None
    """Number of the event that records it; None: it was only counted."""


def plan_trimming(log: Path, rule: TrimRule, progress: Progress | None = None) -> TrimmedLog:
    """Return what `trim_log` would take out; nothing is written.

    Raises:
        CorruptLogError: A segment is damaged.
        LogError: Some of what is to be redacted lies in a store only.
    """
    check_not_virtual(log)
    reader = LogReader(log)
    _check_on_disk(reader, rule)
    return TrimmedLog(trimming.count_selected(reader, rule.select, progress), None)


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
        progress: Called with the progress of the work.
        writing: Options of `append`, for the events that record it.

    Raises:
        LogLockedError: Somebody is writing.
        LogAccessError: The file system says no.
        CorruptLogError: A segment is damaged, or its trimmed copy cannot be verified; it stays as
            it is, and so do those after it.
        LogError: Some of what is to be redacted lies in a store only.
    """
    check_not_virtual(log)
    reader = LogReader(log)
    _check_on_disk(reader, rule)
    if not trimming.takes_anything(reader, rule.select) and not _is_begun(reader):
        return TrimmedLog(trimming.Trimming(), None)
    with append(log, **(writing or {})) as opened:
        reader = LogReader(log)
        begun = _told(rule, reader)
        opened.append(
            chain(rule.recorded_before(), [replace(begun, tombstones=trimming.of_log(reader, ""))]),
            note=note,
        )
    try:
        done = trimming.trim_segments(log, rule.select, check_copy, progress)
    except CorruptLogError:
        _end(log, rule, note, writing)
        raise
    return TrimmedLog(done, _end(log, rule, note, writing))


def _end(log: Path, rule: TrimRule, note: Note, writing: WritingOptions | None) -> int:
    """Record which records are gone now; return the number of the event that says so."""
    remove_stale_tables(log)
    with append(log, **(writing or {})) as opened:
        return opened.append([_told(rule, LogReader(log))], note=note).commit.last_event


def _check_on_disk(reader: LogReader, rule: TrimRule) -> None:
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
    """Return whether a trimming was stopped before the log could record its end."""
    window = Window(kinds=kinds_mask([HistoryTrimmed]))
    told = [one.event.tombstones for batch in reader.batches(window) for one in batch
            if isinstance(one.event, HistoryTrimmed)]  # fmt: skip
    mine = [one for one in told if one.startswith(trimming.of_log(reader, ""))]
    return bool(mine) and mine[-1] == trimming.of_log(reader, "")


def _told(rule: TrimRule, reader: LogReader) -> HistoryTrimmed:
    return trimming.told_of(reader, before=rule.before, rule=rule.words, reason=rule.reason)


_EXPIRING = [kind.kind for kind in EXPIRING]


class Retention:
    """What goes of all that was recorded before a moment, up to the last keyframe before it."""

    reason = TrimReason.EXPIRED

    def __init__(
        self, log: Path | LogReader, until_ns: int, *, always_has_horizon: bool = False
    ) -> None:
        """Look how far the horizon can be moved.

        Args:
            log: Its folder; or what reads it.
            until_ns: What was recorded before this moment may go.
            always_has_horizon: Let the horizon move though nothing goes: the log has never known
                all of what was before.
        """
        self.always_has_horizon = always_has_horizon
        self._reader = log if isinstance(log, LogReader) else LogReader(log)
        self._until_ns = until_ns
        found = _horizon(self._reader, until_ns)
        self.horizon, self._held_by = found.event, found.held_by
        self._state_events = state_events(found.state)

    @property
    def before(self) -> int:
        """Number of the first event that stays."""
        return self.horizon

    @property
    def words(self) -> str:
        """What goes, for the log's own history."""
        until = format_second(self._until_ns)
        held = self._held_by
        also = "" if held is None else f" and before what event {held} takes back"
        return f"what was recorded before {until}, up to the last keyframe before that{also}"

    def recorded_before(self) -> list[Event]:
        """Return the pins whose moments need what goes, with their states."""
        if self.horizon <= self._reader.horizon:
            return []
        horizon_ns = _recorded_before(self._reader, self.horizon)
        return [
            with_state(pin, state, self.horizon)
            for pin in pins(self._reader).values()
            if pin.at_ns < horizon_ns and (state := self._state_of(pin)) is not None
        ]

    def _state_of(self, pin: MomentPinned) -> DoorMapState | None:
        """Return what goes of a pinned moment: what comes later may be taken back yet."""
        if pin.at_ns < self._reader.horizon_ns:
            return pinned_state(self._reader, pin.at_ns, before_event=self.horizon)
        return state_at(self._reader, at_ns=pin.at_ns, limit=self.horizon - 1)

    def select(self, segment: Segment) -> Retention | None:
        """Return what goes of a segment; None: nothing."""
        is_moved = self.horizon > self._reader.horizon
        return self if is_moved and segment.header.first_event < self.horizon else None

    def gone(self, page: Page) -> NDArray[np.bool_]:
        """As `Selection` says."""
        numbers = page.numbers(np.arange(len(page.heads)))
        can_go = np.isin(kinds_of(page.heads["channel_id"]), _EXPIRING) & (numbers < self.horizon)
        return can_go & ~np.isin(numbers, self._state_events)

    def keyframe(self, data: bytes) -> bytes | None:
        """As `Selection` says: those before the horizon are of no use."""
        event = keyframes.event_of(data)
        return data if event is None or event + 1 >= self.horizon else None


def _recorded_before(reader: LogReader, horizon: int) -> int:
    """Return when the last event before a horizon was recorded, or a little later."""
    first_segment = reader.segment_of(horizon) or 0
    later = (one for one in reader.commits(first_segment) if one.last_event >= horizon)
    commit = next(later, None)  # the very next may have been taken out
    return reader.last_log_time_ns() + 1 if commit is None else commit.recorded_ns


class _Horizon(NamedTuple):
    event: int
    """Number of the first event after it."""
    state: DoorMapState
    """Of the doors there; empty: it does not move."""
    held_by: int | None
    """The retraction that kept it from being later; None: none did."""


def _horizon(reader: LogReader, until_ns: int) -> _Horizon:
    """Return the place after the last keyframe that can be the horizon.

    All before it was recorded before the moment, in closed segments, and no commit reaches across
    it. A later retraction may not reach before it: the keyframe would know what is not true any
    more.
    """
    held: int | None = None
    for place, chunk, event in _keyframes_before(reader, until_ns):
        if event <= reader.horizon:
            break
        reaching = _first_reaching_before(reader, event)
        if reaching is not None:
            held = reaching
        elif (state := _state_before(reader.segments[place], chunk, event)) is not None:
            return _Horizon(event, state, held)
    return _Horizon(reader.horizon, DoorMapState(), held)


def _state_before(segment: Segment, chunk: int, event: int) -> DoorMapState | None:
    """Return the state before an event, if a keyframe between two commits holds it."""
    commit = commit_of(segment, event)
    if commit is not None and commit.first_event < event:
        return None
    state = keyframe_at(segment, chunk)
    return state if state is not None and state.event == event - 1 else None


def _keyframes_before(reader: LogReader, until_ns: int) -> Iterator[tuple[int, int, int]]:
    """Yield segment, chunk and the next event of keyframes by a moment, the last first."""
    for place in reversed(range(len(reader.segments))):
        segment = reader.segments[place]
        rows, firsts = segment.chunks.rows, numbers_of(segment)[0]
        is_before = (rows["kinds"] == KEYFRAME_BIT) & (rows["start_ns"] < until_ns)
        for chunk in reversed(np.flatnonzero(is_before).tolist()):
            needed = reader.segments[: place + (chunk > 0)]
            if all(one.closed and one.told is None for one in needed):
                yield place, chunk, int(firsts[chunk])


def _first_reaching_before(reader: LogReader, event: int) -> int | None:
    """Return the first retraction from an event on that takes back something before it."""
    later = retractions_after(reader, event - 1)
    return next((one.number for one in later if one.first_event < event), None)


def check_copy(log: LogReader, copy: Segment) -> None:
    """Check that a log can be opened, read and verified with the trimmed copy of a segment.

    Args:
        log: The log with the copy in the place of the segments that it stands for.
        copy: The copy, under the path that it will have.

    Raises:
        CorruptLogError: It cannot; the message says that the log is unchanged.
    """
    try:
        _read(log, copy)
    except CorruptLogError as error:
        raise _refusal(copy, str(error)) from error
    for finding in Verifier(_CopyPlace(copy), ReplayKeyframeCheck).run().findings:
        if finding.severity >= Severity.TORN:
            raise _refusal(copy, f"byte {finding.offset}: {finding.text}")


def _read(log: LogReader, copy: Segment) -> None:
    """Read what the copy holds, and the state at the log's horizon."""
    window = Window(first_event=copy.header.first_event, before_event=end_of(copy))
    for _ in log.batches(window, is_part=True, with_newer=True):
        pass
    if log.horizon:
        place = log.horizon_place()
        segment = log.segments[place.segment]
        state = keyframe_at(segment, place.chunk)
        if state is None or state.event != log.horizon - 1:
            problem = f"no state of event {log.horizon - 1}, the last before its horizon"
            raise CorruptLogError(segment.path, None, problem)


class _CopyPlace(DiskPlace):
    """One file: the copy's bytes, which lie under a temporary name."""

    def __init__(self, copy: Segment) -> None:
        super().__init__(Path(copy.path))
        self._source = copy.source

    @contextmanager
    def opened(self, _file: PurePath) -> Iterator[OpenedFile]:
        """Return the copy's bytes."""
        yield _CopyFile(self._source)


class _CopyFile:
    """An `OpenedFile` of bytes that are mapped already."""

    is_regular = True

    def __init__(self, source: ByteSource) -> None:
        self.size, self.identity, self._source = source.size, source.identity, source

    def read_into(self, target: memoryview, at: int) -> int:
        """Fill in bytes from an offset on; return how many."""
        data = self._source.read(at, at + len(target))
        target[: len(data)] = data
        return len(data)


def _refusal(copy: Segment, problem: str) -> CorruptLogError:
    return CorruptLogError(
        copy.path,
        None,
        f"the trimmed copy of it failed its check ({problem}); the log was left as it was. "
        "Please report this.",
    )
