"""Verifies, copies and recovers a log, with its keyframes compared with the replay.

A keyframe is what a segment says the state was; the replay is what the events say. Also keeps the
door map after the last commit current without reading: a writer's keyframes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path, PurePath

from semmap_log.core.batches.event_batch import EventBatch, Retractions
from semmap_log.core.folds.door_map import STATE_VERSION, DoorMapState
from semmap_log.core.io.clock import Clock
from semmap_log.core.model.events import Retracted
from semmap_log.core.texts import command_line
from semmap_log.errors import LogError, SemmapError
from semmap_log.log.replay import keyframes
from semmap_log.log.replay.read_model.indexing import index_problems
from semmap_log.log.replay.written_state import WrittenState
from semmap_log.store import repairing, verification
from semmap_log.store.byte_layout import (
    CHUNK_BYTES,
    KEYFRAME_CHANNEL,
)
from semmap_log.store.copying import Copied, copy_log
from semmap_log.store.pages import Page
from semmap_log.store.records import MESSAGE
from semmap_log.store.repairing import Recovered, RecoveryPlan, StateParts
from semmap_log.store.verification import Progress, Verification
from semmap_log.store.verification.file_place import FilePlace
from semmap_log.store.verification.findings import Finding, Severity
from semmap_log.store.verification.hash_chain import Report
from semmap_log.store.verification.keyframe_place import KeyframePlace, Reread
from semmap_log.store.verification.pieces import Piece


class ReplayKeyframeCheck:
    """Folds the events as they come, and compares each keyframe with the state so far.

    A `KeyframeCheck`.

    A retraction of events that are already folded has the state folded again, from the last
    keyframe that it does not touch.
    """

    def __init__(self, report: Report, reread: Reread) -> None:
        self.compared = 0
        self._report = report
        self._reread = reread
        self._state: DoorMapState | None = None
        self._retractions: list[tuple[int, int, int]] = []
        """Number, first and last event of each."""
        self._is_stale = False
        self._good: list[tuple[int, KeyframePlace]] = []
        """The event of each keyframe that was right, and where it lies."""
        self._waiting: list[bytes | memoryview] = []
        self._waiting_size = 0
        self._has_given_up = False
        self._base = self._seen = 0
        self._path = PurePath()

    def begin(self) -> None:
        """Begin at the log's first event, where the state is empty."""
        self._state, self._good = DoorMapState(), [(-1, KeyframePlace(0, 0))]

    def forget(self) -> None:
        """Events are missing: no state is known until the next keyframe."""
        self._state, self._is_stale = None, False
        self._retractions, self._good, self._waiting, self._waiting_size = [], [], [], 0

    def give_up(self) -> None:
        """Compare no more: events that nobody here understands may have changed the state."""
        self.forget()
        self._has_given_up = True

    def add(self, path: PurePath, piece: Piece, place: KeyframePlace, next_event: int) -> None:
        """Take the next chunk, of which `next_event` is the first event, or comes before it."""
        start, self._path = 0, path
        for channel, _, _, _, begin, end in piece.messages:
            if channel == KEYFRAME_CHANNEL:
                self._wait(piece.records[start:begin], next_event)
                self._keyframe(bytes(piece.records[begin + MESSAGE.size : end]), place)
                start = end
        self._wait(piece.records[start:], next_event)

    def finish(self) -> None:
        """Read the events that wait: their payloads must be what their channels carry."""
        self._fold()

    def _wait(self, records: bytes | memoryview, next_event: int) -> None:
        """Keep records until there are many: small pages cost most of the time."""
        if not self._waiting:
            self._base = next_event
        if len(records):
            self._waiting.append(records)
            self._waiting_size += len(records)
        if self._waiting_size >= CHUNK_BYTES:
            self._fold()

    def _fold(self) -> None:
        parts, self._waiting, self._waiting_size = self._waiting, [], 0
        batch = self._events(parts, self._base)
        if batch is None or not len(batch):
            return
        self._seen = int(batch.number[-1])
        if self._state is None:
            return
        if Retracted in batch:
            rows, numbers = batch[Retracted], batch.number[batch.where(Retracted)]
            ranges = zip(
                numbers.tolist(),
                rows["first_event"].tolist(),
                rows["last_event"].tolist(),
                strict=True,
            )
            self._retractions += ranges
            self._is_stale = True
        elif not self._is_stale:
            self._state.note_used_ids(batch)
            self._state.apply(self._hidden().visible(batch))

    def _events(self, parts: list[bytes | memoryview], base: int) -> EventBatch | None:
        if not parts:
            return None
        try:
            return Page(b"".join(parts), base, self._path).events()
        except (SemmapError, ValueError) as error:
            self._wrong("payload", None, f"an event's payload cannot be read: {error}")
            self.forget()
            return None

    def _hidden(self) -> Retractions:
        retractions = Retractions()
        retractions.ranges = [(first, last) for _, first, last in self._retractions]
        return retractions

    def _keyframe(self, data: bytes, place: KeyframePlace) -> None:
        self._fold()
        if self._has_given_up:
            return
        version = keyframes.version_of(data)
        if version is None:
            self._wrong("keyframe", place.offset, "a keyframe that is cut")
            return
        if version != STATE_VERSION:
            text = f"a keyframe of state version {version} is not compared: ours is {STATE_VERSION}"
            self._report(Finding("keyframe", Severity.NOTE, self._path, place.offset, None, text))
            return
        if self._is_stale:
            self._refold()
        if self._state is None:
            self._adopt(data, place)
        elif keyframes.encode(self._state) != data:
            event = self._state.event
            text = f"the keyframe is not the state after event {event} that a replay gives"
            self._wrong("keyframe", place.offset, text)
        else:
            self.compared += 1
            self._good.append((self._state.event, place))

    def _adopt(self, data: bytes, place: KeyframePlace) -> None:
        """Take the state from a keyframe that fits its own hash: there is nothing to compare."""
        self._state = keyframes.decode(data)
        if self._state is None:
            self._wrong("keyframe", place.offset, "the keyframe does not fit its state hash")
            return
        self._good = [(self._state.event, place)]

    def _refold(self) -> None:
        """Fold once more, from the last right keyframe that rests on nothing retracted later."""
        self._is_stale = False
        self._state, hidden = None, self._hidden()
        behind: int | None = None
        for event, place in reversed(self._good):
            if behind is not None and event >= behind:
                continue  # it rests on the same retracted event
            state = self._state_at(event, place)
            later = [(first, last) for number, first, last in self._retractions if number > event]
            behind = state.first_among(later)
            if behind is None:
                for batch in self._batches_after(event, place):
                    state.note_used_ids(batch)
                    state.apply(hidden.visible(batch))
                self._state = state
                return

    def _state_at(self, event: int, place: KeyframePlace) -> DoorMapState:
        if event < 0:
            return DoorMapState()
        piece = next(self._reread(place))
        (state,) = [
            keyframes.decode(bytes(piece.records[begin + MESSAGE.size : end]))
            for channel, _, _, _, begin, end in piece.messages
            if channel == KEYFRAME_CHANNEL
        ]
        assert state is not None  # it was right before
        return state

    def _batches_after(self, event: int, place: KeyframePlace) -> Iterator[EventBatch]:
        """Yield the events from a place on, as far as they have come."""
        parts: list[bytes | memoryview] = []
        for piece in chain(self._reread(place), [None]):
            if piece is not None:
                parts.append(piece.records)
            if piece is None or sum(map(len, parts)) >= CHUNK_BYTES:
                batch = self._events(parts, event + 1)
                parts = []
                if batch is not None and len(batch):
                    yield batch.select(batch.number <= self._seen)
                    if batch.number[-1] >= self._seen:
                        return

    def _wrong(self, kind: str, offset: int | None, text: str) -> None:
        self._report(Finding(kind, Severity.DAMAGE, self._path, offset, None, text))


_PARTS = StateParts(ReplayKeyframeCheck, WrittenState)


def verify(
    path: PurePath | FilePlace,
    head: bytes | None = None,
    progress: Progress | None = None,
    *,
    ends: Collection[int] = (),
) -> Verification:
    """Read all of a log, or one segment of it, and return what is wrong; as `verification.verify`.

    Args:
        path: The log's folder, one .mcap file or a URL of it; or another place.
        head: Hash of a commit that the log must hold, kept elsewhere.
        progress: Called with the number of bytes read.
        ends: Event numbers: whether a commit ends before each of them, and with which hash.

    Raises:
        LogAccessError: The file system does not let us read it.
        LogError: It is of another format version.
    """
    found = verification.verify(path, ReplayKeyframeCheck, head, progress, ends=ends)
    return replace(found, findings=(*found.findings, *_index_findings(path)))


def copy(
    log: Path, target: Path, *, full: bool = False, progress: Progress | None = None
) -> Copied:
    """Copy a log, or bring a copy of it up to date; as `copying.copy_log`.

    Args:
        log: Its folder; it may be written meanwhile.
        target: A folder that is not there yet, or is empty, or an earlier copy of the same log.
        full: Read and verify what is there already, too; what is damaged there is copied again.
        progress: Called with the number of bytes copied and verified.

    Raises:
        LogExistsError: Something else lies at the target.
        LogError: Another log lies there, or one that went on by itself; or there is no log.
        LogLockedError: Somebody writes to the copy.
        CorruptLogError: The log is damaged; the copy is as it was.
        OutputError: The copy cannot be written; it holds what it held, or some segments more.
    """
    return copy_log(log, target, ReplayKeyframeCheck, full=full, progress=progress)


def _index_findings(path: PurePath | FilePlace) -> list[Finding]:
    """Return which tables of the read model are not used: nothing of the log is lost with them."""
    if not isinstance(path, Path):
        return []
    try:
        problems = index_problems(path)
    except LogError:  # which `verify` has reported
        return []
    do = f"`{command_line('index', path)}` makes it anew."
    return [
        Finding("index", Severity.WARNING, file, None, None, f"not used: {said} {do}")
        for file, said in problems
    ]


def plan_recovery(path: Path, progress: Progress | None = None) -> RecoveryPlan:
    """Read a log and return what a recovery would save and lose; as `repairing.plan_recovery`.

    Raises:
        NewerLogError: It is damaged, and holds what only a later version can take over.
        LogError: It cannot be read, or is no log.
    """
    return repairing.plan_recovery(path, ReplayKeyframeCheck, progress)


def recover(
    log: Path,
    *,
    progress: Progress | None = None,
    clock: Clock | None = None,
    entropy: Callable[[int], bytes] = os.urandom,
) -> Recovered:
    """Put what is whole of a damaged log in its place; as `repairing.recover`.

    Raises:
        LogLockedError: Somebody is writing.
        LogAccessError: The file system does not let us.
        LogError: There is no log, or what was made of it is not good; nothing is changed then.
    """
    return repairing.recover(log, _PARTS, progress=progress, clock=clock, entropy=entropy)


def recover_into(
    log: Path,
    target: Path,
    *,
    progress: Progress | None = None,
    clock: Clock | None = None,
    entropy: Callable[[int], bytes] = os.urandom,
) -> Recovered:
    """Make a new log of what is whole of a damaged one, which stays; as `repairing.recover_into`.

    Raises:
        LogExistsError: There is something at the target.
        LogAccessError: The file system does not let us.
        LogError: There is no log, or what was made of it is not good; nothing is changed then.
    """
    return repairing.recover_into(
        log, target, _PARTS, progress=progress, clock=clock, entropy=entropy
    )
