"""What of a damaged log can be saved, and what is lost: found by reading, nothing is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from semmap_log.core.messages import OBJECT_KINDS, decode, fixed_layout
from semmap_log.core.model.events import KINDS, DoorAdded, DoorEvent
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import ElsewhereError, LogError, NewerLogError
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import kind_of_channel
from semmap_log.store.header import LogInfo, SegmentHeader, TrimReason, with_all_of
from semmap_log.store.records import MESSAGE
from semmap_log.store.removed_part import read_removed_part
from semmap_log.store.salvage.kept_beginning import KeptBeginning, kept_beginning, kept_below
from semmap_log.store.salvage.rewriting import Rewriter
from semmap_log.store.salvage.trimmed_parts import TrimmedPart, TrimmedParts
from semmap_log.store.verification import (
    GoneCommits,
    Progress,
    Severity,
    Verification,
    Verifier,
    WholeCommit,
)
from semmap_log.store.verification.file_bytes import Vanished
from semmap_log.store.verification.keyframe_place import NewKeyframeCheck
from semmap_log.store.zip_files import refuse_zip


@dataclass(frozen=True, slots=True)
class Loss:
    """Events that cannot be saved."""

    first_event: int
    last_event: int | None
    """None: it is not known how many followed the last that is whole."""
    after_ns: int | None
    """Log time of the last record before them; None: there is none."""
    before_ns: int | None
    """Log time of the first record behind them; None: there is none."""
    files: tuple[str, ...]
    why: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RecoveryPlan:
    """What a recovery would do."""

    path: Path
    verification: Verification
    losses: tuple[Loss, ...]
    doors: tuple[int, ...]
    """Doors that have events which survive, while the one that added them is lost."""
    dropped: tuple[int, ...]
    """Retractions of events that are all lost: dropped as well."""
    commits: int
    """That survive."""
    events: int
    span_ns: tuple[int, int] | None
    """Log times of the first and last event that survive."""
    header: SegmentHeader | None
    """Of the log's first segment, with what later versions have put at any head; None: none of them
    can be read."""
    keeps_numbers: bool
    """Every event that survives keeps its number, and every commit its hash."""
    trimmed: tuple[TrimmedPart, ...] = ()
    """Where something was taken out of what survives, on purpose …"""
    beginning: KeptBeginning | None = None
    """… and what is taken over as it is: the log has a horizon."""

    @property
    def info(self) -> LogInfo | None:
        """What is fixed of the log; None: no head can be read."""
        return None if self.header is None else self.header.info

    @property
    def has_to_do(self) -> bool:
        """Tell whether there is damage that the next writer would not heal by itself."""
        return bool(self.verification.of(Severity.DAMAGE))

    @property
    def lost_events(self) -> int | None:
        """How many events are lost; None: it cannot be known."""
        counts = [
            None if loss.last_event is None else loss.last_event - loss.first_event + 1
            for loss in self.losses
        ]
        known = [count for count in counts if count is not None]
        return sum(known) if len(known) == len(counts) else None


def plan_recovery(
    path: Path, new_check: NewKeyframeCheck, progress: Progress | None = None
) -> RecoveryPlan:
    """Read a log and return what a recovery would save and lose.

    Args:
        path: As for `verify`; no zip.
        new_check: As for `verify`.
        progress: As for `verify`.

    Raises:
        ElsewhereError: A part of it lies in a store only.
        NewerLogError: It is damaged, and holds what only a later version can take over.
        LogError: It cannot be read, or is no log; or its horizon is damaged.
    """
    refuse_zip(path)
    if path.is_dir():
        _check_is_all_here(path)
    taken = _Taken()
    verifier = Verifier(
        path,
        new_check,
        progress=progress,
        on_commit=lambda whole: taken.add(whole, verifier),
        on_gone=lambda gone: taken.add_gone(gone, verifier),
        keep_parts=True,
    )
    try:
        found = verifier.run()
    except Vanished:
        raise LogError(f"{path}: somebody is writing to this log; stop that first.") from None
    beginning = None
    if found.of(Severity.DAMAGE):
        beginning = kept_beginning(verifier.arrangement, found, verifier.trimming)
    if not verifier.arrangement.segments:
        raise LogError("\n".join(f"{f.path}: {f.text}" for f in found.findings))
    if beginning is not None and beginning.is_split:
        taken.take_split(beginning)
    headers = verifier.headers
    is_beyond_us = verifier.has_unknown_changes or (verifier.newer and taken.rewriter.has_moved)
    if is_beyond_us and found.of(Severity.DAMAGE):
        raise NewerLogError(
            f"{path}: damaged, and not to be recovered here: a newer version of semmap-log has "
            f"written {_in_words(verifier.newer)} to it, and only that knows what a new number or "
            "a keyframe must make of them. Nothing was changed; recover with the newer version."
        )
    return RecoveryPlan(
        path=path,
        verification=found,
        losses=tuple(taken.losses(found)),
        doors=tuple(sorted(taken.doors - taken.added)),
        dropped=tuple(taken.rewriter.dropped),
        commits=taken.commits,
        events=taken.events,
        span_ns=taken.span_ns,
        header=with_all_of(headers) if headers else None,
        keeps_numbers=not (taken.rewriter.has_changed or (beginning and beginning.is_split)),
        trimmed=taken.trimmed.found(),
        beginning=beginning,
    )


def _in_words(newer: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {kind}" for kind, count in newer.items())


class _Taken:
    """The commits that survive, counted."""

    def __init__(self) -> None:
        self.rewriter = Rewriter()
        self.commits = self.events = 0
        self.doors: set[int] = set()
        self.added: set[int] = set()
        self.span_ns: tuple[int, int] | None = None
        self._next = self._events_below = 0
        self._gaps: list[tuple[int, int | None, int | None, int | None]] = []
        self.trimmed = TrimmedParts()

    def add(self, whole: WholeCommit, verifier: Verifier) -> None:
        """Take the next commit that is whole; one of the beginning is taken over as it is."""
        commit, below = whole.commit, kept_below(verifier.arrangement)
        self._go_on(commit.first_event, commit.last_event + 1, commit.recorded_ns)
        self.span_ns = (self.span_ns or (commit.recorded_ns, 0))[0], commit.closed_ns
        self._note_doors(whole)
        if commit.last_event < below:
            self.commits, self.events = self.commits + 1, self.events + whole.left
            self._events_below += whole.left
            return
        numbers, dropped = self.rewriter.numbers, len(self.rewriter.dropped)
        if numbers.next_event < below:
            self.rewriter.begin_behind(below, commit.previous_hash, commit.recorded_ns - 1)
        before = numbers.next_event
        self.commits += bool(self.rewriter.rewrite(whole))
        self.events += whole.left - (len(self.rewriter.dropped) - dropped)
        reasons = TrimReason(0) if whole.lacks is None else whole.lacks.reasons
        self.trimmed.add(verifier.place, before, numbers.next_event, reasons)

    def add_gone(self, gone: GoneCommits, verifier: Verifier) -> None:
        """Take in what stands for commits that were taken out."""
        one, below = gone.tombstone, kept_below(verifier.arrangement)
        self._go_on(one.first_event, one.next_event, gone.time_ns)
        if one.first_event < below:
            return
        numbers = self.rewriter.numbers
        if numbers.next_event < below:
            self.rewriter.begin_behind(below, one.previous_hash, gone.time_ns)
        before = numbers.next_event
        self.rewriter.go_on_behind(gone)
        self.trimmed.add(verifier.place, before, numbers.next_event, one.reasons)

    def _go_on(self, first_event: int, next_event: int, time_ns: int) -> None:
        """Note which events are lost before what comes next."""
        last_ns = self.span_ns[1] if self.span_ns else None
        if first_event > self._next:
            self._gaps.append((self._next, first_event - 1, last_ns, time_ns))
        self._next = next_event

    def take_split(self, beginning: KeptBeginning) -> None:
        """Count the commit of the beginning that becomes two, which is not whole as it is."""
        self.commits += 2
        self.events += beginning.events - self._events_below
        below = beginning.next_event
        self._gaps = [gap for gap in self._gaps if gap[0] >= below]
        self._next = max(self._next, below)

    def losses(self, found: Verification) -> list[Loss]:
        """Return the gaps, each with what was found wrong there."""
        wrong = [f for f in found.of(Severity.DAMAGE) if f.events is not None]
        behind = [f.events[1] for f in wrong if f.events and f.events[0] >= self._next]
        if behind:
            known = [last for last in behind if last is not None]
            last = max(known) if len(known) == len(behind) else None
            self._gaps.append((self._next, last, self.span_ns[1] if self.span_ns else None, None))
        losses = []
        for first, last, after_ns, before_ns in self._gaps:
            mine = [f for f in wrong if f.events and f.events[0] == first]
            files = tuple(dict.fromkeys(f.path.name for f in mine))
            why = tuple(dict.fromkeys(f.text for f in mine))
            losses.append(Loss(first, last, after_ns, before_ns, files, why))
        return losses

    def _note_doors(self, whole: WholeCommit) -> None:
        """Remember which doors its events are about, and which it adds."""
        for part in whole.parts:
            for channel, _, _, _, start, end in part.piece.messages[part.first : part.last]:
                kind = kind_of_channel(channel)
                if kind is None or kind > len(KINDS) or not issubclass(KINDS[kind - 1], DoorEvent):
                    continue
                data = bytes(part.piece.records[start + MESSAGE.size : end])
                door = _door_id(kind, data)
                self.doors.add(door)
                if kind == DoorAdded.kind:
                    self.added.add(door)


def _door_id(kind: int, data: bytes) -> int:
    if kind in OBJECT_KINDS:
        return int(decode(kind, data, None).door_id)  # type: ignore[attr-defined]
    return int(fixed_layout(kind).unpack(data)["door_id"])


def _check_is_all_here(log: Path) -> None:
    """Refuse a log of which a part lies in a store only: what is made anew would begin elsewhere.

    Raises:
        ElsewhereError: It does.
    """
    part = read_removed_part(LogFolder(log))
    if part is not None:
        fetch = command_line("fetch", part.url, "DIR")
        raise ElsewhereError(
            f"{log}: {counted(len(part.files), 'segment')} of it lie at {part.url} only; bring "
            f"the log back ({fetch}), copy the later .mcap files of this folder beside them, and "
            "recover that."
        )
