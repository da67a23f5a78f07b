"""The door map at a moment: the nearest keyframe, and what came after it.

A keyframe is a cache. One serves a moment if all its events had happened by then, and if it holds
nothing that a later retraction hides. After it only those chunks are read that contain events which
had happened by then, too. Without any keyframe the answer is the same, from the log's beginning.

Pinned moments: their state is kept when what was before the horizon is not. While the log holds all
that the answer needs, a pin is a name for a moment. Before its events are removed, retention writes
the state of that moment into the log; later reports of it are folded onto it.

The keyframe at the horizon stands for the oldest events, which were taken out, but for those that
set a door's state there: they stay, since how long a state holds depends on how it was seen. It
holds, for each field of each door, which event wrote it last: if that is gone, it is put back as an
update of that number and time.
So a fold that begins with these events has the state of the horizon when it reaches it. What was
before is not known: from its adding on a door is UNKNOWN, until what its state was at the horizon
had happened.

A checkpoint is a fold's state and position in a file, from which it continues later. The file: a
line `semmap-log checkpoint`, a line of JSON with the log, the commit (by event number and hash),
the projection and its version, then the state, then the sha256 of all of it. It is synced before it
takes its name in one step, so that the last checkpoint that was saved always exists. It is a cache,
and never used unless it fits:

- not a checkpoint, of another log, of another projection: an error, and the file is left alone;
- damaged, of another version, or of events that the log does not hold (a backup was restored, and
  continued differently): a `CheckpointWarning`, and the fold begins at the log's start;
- a retraction since then hides what was folded, or something was redacted since then that the state
  may still contain: the same, without a warning.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
import warnings
import zlib
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from semmap_log import errors
from semmap_log.core.batches.event_batch import EventBatch, RecordedEvent, Retractions
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.plain_state import dump_plain, load_plain
from semmap_log.core.folds.projection import Dumping, Projection, name_of, version_of
from semmap_log.core.folds.registers import NEVER
from semmap_log.core.io.disk import (
    check_outside_log,
    left_by_killed,
    output_errors,
    read_own,
    replace_file,
)
from semmap_log.core.io.inflating import inflated
from semmap_log.core.io.progress import Progress
from semmap_log.core.model import events as ev
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.meaning import PARTS, REGISTER_OF
from semmap_log.core.texts import counted
from semmap_log.log.replay import keyframes
from semmap_log.store.header import TrimReason
from semmap_log.store.pages import EVENT_BITS, KEYFRAME_BIT, kinds_mask
from semmap_log.store.reading.reader import BEGINNING, ChunkPlace, LogReader
from semmap_log.store.reading.segment_reading import page_at
from semmap_log.store.reading.segment_scan import Segment, numbers_of
from semmap_log.store.reading.window import Window
from semmap_log.store.record_scan import most_unpacked


def pins(reader: LogReader) -> dict[str, ev.MomentPinned]:
    """Return the pins of a log by their names, as they were made, or got a state, last."""
    hidden = reader.retractions()
    found: dict[str, ev.MomentPinned] = {}
    for batch in reader.batches(Window(kinds=kinds_mask([ev.MomentPinned]))):
        for recorded in hidden.visible(batch):
            pin = recorded.event
            assert isinstance(pin, ev.MomentPinned), "no other kind was requested"
            known = found.get(pin.name)
            if pin.keyframe or known is None or known.at_ns != pin.at_ns:
                found[pin.name] = pin
    return found


def kept_pin(reader: LogReader, at_ns: int) -> ev.MomentPinned | None:
    """Return a pin of a moment that has its state; None: there is none."""
    return next((p for p in pins(reader).values() if p.at_ns == at_ns and p.keyframe), None)


def pinned_state(
    reader: LogReader, at_ns: int, *, before_event: int | None = None
) -> DoorMapState | None:
    """Return the state of a moment before the horizon, with all that is known today.

    None: it was not pinned, or its state cannot be used.

    Args:
        reader: Of the log.
        at_ns: The moment.
        before_event: Only events below that number; None: all.
    """
    pin = kept_pin(reader, at_ns)
    state = None if pin is None else unpacked(pin.keyframe)
    if pin is None or state is None:
        return None
    window = Window(
        first_event=pin.next_event, before_event=before_event, happened_before_ns=at_ns + 1
    )
    retractions = reader.retractions()
    for batch in reader.batches(window):
        state.note_used_ids(batch)
        state.apply(retractions.visible(batch))
    return state


def with_state(pin: ev.MomentPinned, state: DoorMapState, next_event: int) -> ev.MomentPinned:
    """Return a pin with the state of its moment.

    Args:
        pin: The pin.
        state: With the events below `next_event`.
        next_event: What comes from there on is not in it.
    """
    data = base64.b64encode(zlib.compress(keyframes.encode(state))).decode()
    return ev.MomentPinned(at_ns=pin.at_ns, next_event=next_event, name=pin.name, keyframe=data)


def unpacked(text: str) -> DoorMapState | None:
    """Return the state in a pin; None: it is of another version, damaged, or larger than any."""
    try:
        packed = base64.b64decode(text, validate=True)
        return keyframes.decode(inflated(packed, most_unpacked(len(packed))))
    except ValueError:
        return None


def events_at_horizon(
    reader: LogReader, window: Window, doors: Collection[int] | None
) -> Iterator[EventBatch]:
    """Yield what a log still holds of the time before its horizon, as one batch.

    Args:
        reader: Of a log that has a horizon.
        window: Which events; it has no beginning, and ends after the horizon. Those that set states
            come, too, whatever its kinds are.
        doors: Only events about these, where they are about a door; None: all.

    Raises:
        HorizonError: The state at the horizon cannot be read.
    """
    before = replace(window, before_event=reader.horizon, kinds=window.kinds | _STATE_BITS)
    left = [recorded for batch in reader.batches(before, is_part=True) for recorded in batch]
    state = _state_at_horizon(reader)
    found = [
        *_without_first_states(left, state),
        *_last_writes(state, but=[one.number for one in left]),
    ]
    if doors is not None:
        wanted = set(doors)
        found = [one for one in found if getattr(one.event, "door_id", None) in wanted]
    if found:
        yield _batch(found)


def last_writes(reader: LogReader) -> list[RecordedEvent]:
    """Return the state at a log's horizon, as far as no remaining event shows it.

    Each is an update with the number of an event that is gone, and sets what that event wrote to a
    door and no other wrote since; numbers ascend. When it was recorded is not known.

    Raises:
        HorizonError: The state at the horizon cannot be read.
    """
    before = reader.batches(Window(before_event=reader.horizon), is_part=True)
    left = [number for batch in before for number in batch.number.tolist()]
    found = _last_writes(_state_at_horizon(reader), but=left)
    return sorted(found, key=lambda one: one.number)


def _state_at_horizon(reader: LogReader) -> DoorMapState:
    place = reader.horizon_place()
    state = keyframe_at(reader.segments[place.segment], place.chunk)
    if state is None:
        raise errors.HorizonError(
            f"{reader.folder}: the state at its horizon, event {reader.horizon}, is not there or "
            "cannot be used; verify the log."
        )
    return state


_STATE_BITS = kinds_mask(ev.STATE_KINDS)
"""Of these kinds, the events that set a door's state at the horizon stay."""


def state_events(state: DoorMapState) -> NDArray[np.int64]:
    """Return the numbers of the events that set the states of doors, ascending."""
    numbers = state.to_arrays()[f"{REGISTER_OF[ev.Changed.STATE]}_event"]
    found: NDArray[np.int64] = np.unique(numbers[numbers != NEVER])
    return found


def _without_first_states(
    left: list[RecordedEvent], state: DoorMapState
) -> Iterator[RecordedEvent]:
    """Yield events, those that add a door with UNKNOWN where its state was another later."""
    for one in left:
        event = one.event
        if isinstance(event, ev.DoorAdded):
            stamp = state.stamp(event.door_id, "state")
            if stamp is None or stamp[1] != one.number:
                event = replace(event, state=DoorState.UNKNOWN)
        yield replace(one, event=event)


def _last_writes(state: DoorMapState, *, but: list[int]) -> Iterator[RecordedEvent]:
    """Yield who wrote the fields of each door last, as updates; not the events of these numbers."""
    arrays = state.to_arrays()
    written: dict[tuple[int, int, int], dict[str, Any]] = {}
    for part in PARTS:
        register = REGISTER_OF[part]
        happened, numbers = arrays[f"{register}_happened_ns"], arrays[f"{register}_event"]
        for row in np.flatnonzero(~np.isin(numbers, [NEVER, *but])).tolist():
            key = (int(numbers[row]), int(happened[row]), int(arrays["door_id"][row]))
            values = written.setdefault(key, {"changed": ev.Changed(0)})
            values["changed"] |= part
            values |= {name: arrays[name][row].item() for name in PARTS[part]}
    for (number, happened_ns, door_id), values in written.items():
        yield RecordedEvent(number, happened_ns, _update(door_id, values, happened_ns))


def _update(door_id: int, values: dict[str, Any], happened_ns: int) -> ev.Event:
    nothing = {"level": 0, "x": 0.0, "y": 0.0, "theta": 0.0, "width": 0.0, "state": 0,
               "prob_open": np.nan, "prob_closed": np.nan}  # fmt: skip
    return ev.event_of(ev.DoorUpdated, nothing | values | {"door_id": door_id}, happened_ns)


def _batch(events: list[RecordedEvent]) -> EventBatch:
    events = sorted(events, key=lambda one: one.number)
    made = EventBatch.from_events([one.event for one in events])
    numbers = np.array([one.number for one in events], np.int64)
    recorded = np.array([one.recorded_ns for one in events], np.int64)
    return replace(made, number=numbers, recorded_ns=recorded, known_door_ids=None)


S = TypeVar("S")

MAGIC = b"semmap-log checkpoint\n"
FORM = 1
"""Of the file; another's checkpoints are not used."""
DIGEST_BYTES = 32
START_BYTES = 256
"""Of a file: in them stands which log it is of."""


class Checkpoint(Generic[S]):
    """The file that keeps a projection's state in one log."""

    def __init__(self, path: Path, projection: Projection[S], reader: LogReader) -> None:
        """Name the file; nothing is read or written yet.

        Raises:
            OutputError: It cannot lie there.
        """
        folder = path.absolute().parent
        if not folder.is_dir():
            raise errors.OutputError(f"{path}: there is no such folder; make it first.")
        check_outside_log(reader.folder, path)
        self.path = path
        self._projection = projection
        self._of = {
            "form": FORM,
            "log_id": reader.info.log_id,
            "projection": name_of(projection),
            "version": version_of(projection),
        }

    def load(self, reader: LogReader) -> tuple[Position, S] | None:
        """Return what was saved, if it is a state of the log as it is now.

        Raises:
            CheckpointError: The file is of something else, or cannot be read.
        """
        try:
            data = read_own(self.path)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise errors.CheckpointError(
                f"{self.path}: cannot be read: {error.strerror}."
            ) from error
        if not (data.startswith(MAGIC) or MAGIC.startswith(data)):
            raise errors.CheckpointError(
                f"{self.path}: expected a checkpoint, got another file; it is left as it is. "
                "Choose another path."
            )
        try:
            head, stored = _taken_apart(data)
            if not self._fits(head):
                return None
            position, state = _position(head), self._load_state(stored)
        except (ValueError, LookupError, TypeError, MemoryError, RecursionError) as error:
            self._refuse(f"it is damaged: {error}")
            return None
        if position.is_before_redaction(reader):
            return None
        if not position.is_in(reader):
            self._refuse(
                f"the log does not hold the commit of event {position.event} that it goes on from: "
                "the log was put back, or exchanged"
            )
            return None
        return position, state

    def save(self, position: Position, state: S) -> None:
        """Put a state in the place of what was saved, whole or not at all; lasting on return.

        Raises:
            CheckpointError: The state cannot be stored.
            OutputError: The file cannot be written; the last one is whole.
        """
        head = self._of | {
            "event": position.event,
            "commit_hash": position.commit_hash.hex(),
            "latest_ns": position.latest_ns,
            "retractions": position.retractions,
        }
        whole = MAGIC + json.dumps(head).encode() + b"\n" + self._dump_state(state)
        with output_errors(self.path):
            for leftover in left_by_killed(self.path):
                leftover.unlink(missing_ok=True)
            replace_file(self.path, whole + hashlib.sha256(whole).digest())

    def _fits(self, head: Mapping[str, Any]) -> bool:
        """Return whether a file is of this projection and log.

        Raises:
            CheckpointError: It is of others.
        """
        for key, what in (("log_id", "the log"), ("projection", "the projection")):
            if head[key] != self._of[key]:
                raise errors.CheckpointError(
                    f"{self.path}: expected a checkpoint of {what} {self._of[key]}, got one of "
                    f"{head[key]}; choose another path."
                )
        for key in ("form", "version"):
            if head[key] != self._of[key]:
                self._refuse(f"it is of {key} {head[key]}, and {self._of[key]} is wanted")
                return False
        return True

    def _refuse(self, why: str) -> None:
        warnings.warn(
            f"{self.path}: the checkpoint is not used: {why}. The fold begins at the log's start.",
            errors.CheckpointWarning,
            stacklevel=2,
        )

    def _dump_state(self, state: S) -> bytes:
        projection = self._projection
        return projection.dump(state) if isinstance(projection, Dumping) else dump_plain(state)

    def _load_state(self, data: bytes) -> S:
        projection = self._projection
        state: S = projection.load(data) if isinstance(projection, Dumping) else load_plain(data)
        return state


def log_id_of(start: bytes) -> str:
    """Return the id of a checkpoint's log, by the file's first bytes; "": it is no checkpoint.

    Args:
        start: The first `START_BYTES` of the file.
    """
    found = re.match(re.escape(MAGIC) + rb'\{"form": \d+, "log_id": "([0-9a-f]{32})"', start)
    return "" if found is None else found[1].decode()


def _taken_apart(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the head of a file, and the state in it.

    Raises:
        ValueError: It is not as it was written.
    """
    whole, digest = data[:-DIGEST_BYTES], data[-DIGEST_BYTES:]
    if not whole.startswith(MAGIC) or hashlib.sha256(whole).digest() != digest:
        raise ValueError("its sha256 is another")
    line, _, state = whole[len(MAGIC) :].partition(b"\n")
    head: dict[str, Any] = json.loads(line)
    return head, state


def _position(head: Mapping[str, Any]) -> Position:
    return Position(
        event=head["event"],
        commit_hash=bytes.fromhex(head["commit_hash"]),
        latest_ns=head["latest_ns"],
        retractions=tuple(Retraction(*one) for one in head["retractions"]),
    )


def state_at(
    reader: LogReader,
    *,
    at_ns: int | None = None,
    limit: int | None = None,
    uses_keyframes: bool = True,
    progress: Progress | None = None,
    with_newer: bool = False,
) -> DoorMapState:
    """Return the door map as of a moment; without bounds: now.

    Args:
        reader: The log.
        at_ns: Only what had happened by then.
        limit: Only events up to that number, and what they retract.
        uses_keyframes: Whether to start at one; else from the beginning, for the same answer.
        progress: Called with the progress of the reading.
        with_newer: Even where an event of an unknown kind may have changed it.

    Raises:
        NewerLogError: There is such an event.
        CorruptLogError: What was read is not what was written.
        HorizonError: What it would take was older than the log is kept.
    """
    state, start = DoorMapState(), BEGINNING
    if limit is not None and limit < 0:
        return state
    if at_ns is not None and at_ns < reader.horizon_ns:
        return _pinned(reader, at_ns, limit)
    retractions = reader.retractions(limit=limit, with_newer=with_newer)
    if uses_keyframes:
        state, start = _Search(reader, at_ns, limit, retractions).nearest()
    window = Window.up_to(at_ns=at_ns, event=limit)
    reader.check_reaches_horizon(start)
    for batch in reader.batches(window, start=start, progress=progress, with_newer=True):
        state.note_used_ids(batch)
        state.apply(retractions.visible(batch))
    return state


def _pinned(reader: LogReader, at_ns: int, limit: int | None) -> DoorMapState:
    """Return the state of a moment before the horizon.

    Raises:
        HorizonError: It was not pinned, or not all that is known today is to count.
    """
    state = pinned_state(reader, at_ns) if limit is None else None
    if state is None:
        raise reader.horizon_error()
    return state


@dataclass(frozen=True, slots=True)
class _Search:
    """For the last keyframe that serves a moment."""

    reader: LogReader
    at_ns: int | None
    limit: int | None
    retractions: Retractions

    def nearest(self) -> tuple[DoorMapState, ChunkPlace]:
        """Return its state and where the events after it begin; the empty state if none serves."""
        unused: list[str] = []
        found = self._nearest(unused)
        if unused:
            others = f"; nor {counted(len(unused) - 1, 'other')}" if len(unused) > 1 else ""
            warnings.warn(errors.KeyframeWarning(unused[0] + others), stacklevel=3)
        return found

    def _nearest(self, unused: list[str]) -> tuple[DoorMapState, ChunkPlace]:
        behind: int | None = None
        for place, chunk, event in self._candidates():
            if behind is not None and event >= behind:
                continue  # it rests on the same retracted event
            state = keyframe_at(self.reader.segments[place], chunk, unused)
            if state is None or self._knows_of_later(state):
                continue
            behind = state.first_among(self.retractions.after(event).ranges)
            if behind is None:
                return state, ChunkPlace(place, chunk + 1)
        return DoorMapState(), BEGINNING

    def _knows_of_later(self, state: DoorMapState) -> bool:
        """Return whether a state counts events from after the moment which were since taken out.

        What is left of a chunk then happened before the moment.
        """
        return self.at_ns is not None and state.latest_happened_ns > self.at_ns

    def _candidates(self) -> Iterator[tuple[int, int, int]]:
        """Yield segment, chunk and event number of the keyframes of events that all count.

        The last comes first.
        """
        for place in reversed(range(self._last_segment() + 1)):
            segment = self.reader.segments[place]
            chunks = np.flatnonzero(segment.chunks.rows["kinds"] == KEYFRAME_BIT)
            firsts, _ = numbers_of(segment)
            events = firsts[chunks] - 1  # after the last event before it
            serves = np.ones(len(chunks), np.bool_)
            if self.limit is not None:
                serves &= events <= self.limit
            if self.at_ns is not None:
                serves &= chunks <= self._chunks_by(place)
            chosen = zip(chunks[serves].tolist(), events[serves].tolist(), strict=True)
            for chunk, event in reversed(list(chosen)):
                yield place, chunk, event

    def _last_segment(self) -> int:
        """Return the last segment before which all events count."""
        last = len(self.reader.segments) - 1
        if self.limit is not None:
            last = self.reader.segment_of(self.limit + 1) or 0  # its head may follow directly
        if self.at_ns is not None:
            last = min(last, self.reader.segments_by(self.at_ns))
        return last

    def _chunks_by(self, place: int) -> int:
        """Return how many of a segment's first chunks had happened by the moment."""
        assert self.at_ns is not None
        latest = np.maximum.accumulate(self.reader.segments[place].spans["greatest"])
        return int(np.searchsorted(latest, self.at_ns, "right"))


def keyframe_at(
    segment: Segment, chunk: int, unused: list[str] | None = None
) -> DoorMapState | None:
    """Return the state that a chunk with a keyframe holds; None: it cannot be used.

    Args:
        segment: The segment.
        chunk: The chunk's place in it.
        unused: The reason is appended to it if the keyframe is not used.

    Raises:
        CorruptLogError: The chunk is not what was written.
    """
    (data,) = page_at(segment, chunk).keyframes()
    state = keyframes.decode(data)
    if state is None and unused is not None:
        offset = int(segment.chunks.rows["offset"][chunk])
        why = keyframes.why_unused(data)
        unused.append(f"{segment.path}: the keyframe at byte {offset} is not used: {why}")
    return state


NO_EVENT = -1
_REDACTED = str(TrimReason.REDACTED.name).lower()


class Retraction(NamedTuple):
    """A Retracted event: its number, and the range that it hides."""

    number: int
    first_event: int
    last_event: int


@dataclass(frozen=True, slots=True)
class Position:
    """The end of a whole commit, up to which events were taken in; by number, never by time."""

    event: int = NO_EVENT
    """The last event of the commit; -1: the log's beginning."""
    commit_hash: bytes = bytes(32)
    """Of the commit: by the chain of hashes, of everything before it, too."""
    latest_ns: int = 0
    """The latest time by which an event that was taken in is ordered."""
    retractions: tuple[Retraction, ...] = ()
    """Those recorded so far, so that what they hide was left out."""

    def is_in(self, reader: LogReader) -> bool:
        """Return whether the log, as it is now, contains the commit at this position."""
        if self.event == NO_EVENT:
            return True
        commit = reader.find_commit(self.event)
        return commit is not None and (commit.last_event, commit.hash) == (
            self.event,
            self.commit_hash,
        )

    def is_before_redaction(self, reader: LogReader) -> bool:
        """Return whether something was redacted since: what was folded may contain it."""
        if self.event == NO_EVENT:
            return False
        own = f"{reader.info.log_id}:"
        told = (
            one.event
            for batch in reader.batches(_beyond(self.event, None, kinds_mask([ev.HistoryTrimmed])))
            for one in batch
        )
        return any(
            isinstance(event, ev.HistoryTrimmed)
            and event.tombstones.startswith(own)
            and _REDACTED in event.reasons.split(", ")
            for event in told
        )

    def is_touched_by(self, later: Iterable[Retraction]) -> bool:
        """Return whether one of these retractions hides an event that was folded."""
        return any(
            one.first_event <= self.event and not self._leaves_out(one)
            for one in later
            if one.number > self.event
        )

    def is_before_horizon(self, reader: LogReader) -> bool:
        """Return whether the next events are gone because of their age."""
        return NO_EVENT < self.event < reader.horizon - 1

    def _leaves_out(self, later: Retraction) -> bool:
        """Return whether an earlier retraction hides all of it that was folded."""
        last = min(later.last_event, self.event)
        return any(
            one.first_event <= later.first_event and last <= one.last_event
            for one in self.retractions
        )


def retractions_after(
    reader: LogReader, event: int, limit: int | None = None
) -> tuple[Retraction, ...]:
    """Return the retractions with numbers after `event`, and up to `limit`.

    Raises:
        NewerLogError: An event of an unknown kind may have taken back others, too.
    """
    reader.check_known(limit)
    found = Retractions()
    for batch in reader.batches(_beyond(event, limit, kinds_mask([ev.Retracted]))):
        found.apply(batch)
    pairs = zip(found.numbers, found.ranges, strict=True)
    return tuple(Retraction(number, *hidden) for number, hidden in pairs)


def hiding(retractions: Iterable[Retraction]) -> Retractions:
    """Return what leaves out the events that these retractions hide."""
    hidden = Retractions()
    for one in retractions:
        hidden.numbers.append(one.number)
        hidden.ranges.append((one.first_event, one.last_event))
    return hidden


def events_after(
    reader: LogReader,
    event: int,
    limit: int | None = None,
    *,
    at_ns: int | None = None,
    progress: Progress | None = None,
) -> Iterator[EventBatch]:
    """Yield all events with numbers after `event`, and up to `limit`, retracted ones included.

    From a log's beginning on, what stands for the events before its horizon comes first.

    Args:
        reader: Of the log.
        event: The number; -1: from the beginning on.
        limit: The last event; None: the log's.
        at_ns: Those that happened later are not needed; None: all are.
        progress: Called with the progress of the reading.

    Raises:
        CorruptLogError: A chunk is not what was written, or events are missing.
        HorizonError: The limit, or the moment, is before the horizon.
    """
    if event == NO_EVENT and reader.horizon:
        window = Window.up_to(at_ns=at_ns, event=limit)
        reader.check_horizon(window)
        yield from events_at_horizon(reader, window, None)
        event = reader.horizon - 1
    yield from reader.batches(_beyond(event, limit), progress=progress)


def _beyond(event: int, limit: int | None, kinds: int = EVENT_BITS) -> Window:
    return Window(
        first_event=event + 1, before_event=None if limit is None else limit + 1, kinds=kinds
    )
