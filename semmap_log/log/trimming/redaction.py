"""Which records show who was where, or what nobody shall read: the parts of a redaction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import Retractions
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.messages import read_message, type_name
from semmap_log.core.model.doors import CLASS, OUTLINE
from semmap_log.core.model.events import ClassDefined, DoorAnnotated, Event, MomentPinned, RobotPose
from semmap_log.errors import LogError
from semmap_log.log.replay import keyframes
from semmap_log.log.replay.state import pins, unpacked, with_state
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import NOTE_CHANNEL
from semmap_log.store.header import TrimReason
from semmap_log.store.pages import KEYFRAME_BIT, NOTE_BIT, Page, kinds_mask
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import Window

_SALT_END = mcap.MESSAGE.size + 4 + 16
"""Where in the record of a note its texts begin, after the encapsulation and the salt."""


class Part(Protocol):
    """One kind of thing that is redacted."""

    bits: int
    """The kinds of record among which it is: `pages`."""

    @property
    def words(self) -> str:
        """What goes, for the log's own history: no name, and no text that goes."""
        ...

    def gone(self, page: Page) -> NDArray[np.bool_]:
        """Return for each record of a page whether it goes, whatever its number."""
        ...


@dataclass(frozen=True, slots=True)
class Notes:
    """Who did it, with what, and why: all notes, or those of one actor."""

    actor: str | None = None

    bits = NOTE_BIT

    @property
    def words(self) -> str:
        """As `Part` says."""
        return "notes" if self.actor is None else "notes of one actor"

    def gone(self, page: Page) -> NDArray[np.bool_]:
        """As `Part` says."""
        is_note: NDArray[np.bool_] = page.heads["channel_id"] == NOTE_CHANNEL
        if self.actor is None:
            return is_note
        known: dict[bytes, bool] = {}
        for place in np.flatnonzero(is_note).tolist():
            said = bytes(page.record(place)[_SALT_END:])
            if said not in known:
                known[said] = _actor_in(page.record(place)) == self.actor
            is_note[place] = known[said]
        return is_note


@dataclass(frozen=True, slots=True)
class Tracks:
    """Where the robot was."""

    bits = kinds_mask([RobotPose])

    @property
    def words(self) -> str:
        """As `Part` says."""
        return "tracks of the robot"

    def gone(self, page: Page) -> NDArray[np.bool_]:
        """As `Part` says."""
        is_pose: NDArray[np.bool_] = page.heads["channel_id"] == RobotPose.kind
        return is_pose


@dataclass(frozen=True, slots=True)
class Annotation:
    """A text that was set for a door under a key."""

    door_id: int
    key: str

    bits = kinds_mask([DoorAnnotated, MomentPinned]) | KEYFRAME_BIT

    @property
    def words(self) -> str:
        """As `Part` says."""
        return f"annotations {self.key!r} of door {self.door_id}"

    def gone(self, page: Page) -> NDArray[np.bool_]:
        """As `Part` says; and pins, whose states may contain it: others replace them."""
        found = np.asarray(page.heads["channel_id"] == MomentPinned.kind)
        for place in np.flatnonzero(page.heads["channel_id"] == DoorAnnotated.kind).tolist():
            said = read_message(type_name("DoorAnnotated"), page.record(place)[mcap.MESSAGE.size :])
            found[place] = (said["door_id"], said["key"]) == (self.door_id, self.key)
        return found


@dataclass(frozen=True, slots=True)
class Redaction:
    """What is redacted in events below a number, and in notes of their commits; `of` makes it."""

    parts: Sequence[Part]
    before: int
    pins: Sequence[MomentPinned] = ()
    """The pins of the log."""
    later: Sequence[tuple[int, DoorAnnotated]] = ()
    """Texts that later events set under redacted keys, with their event numbers: where such a text
    happened before what goes, it counts then."""
    retractions: Retractions = field(default_factory=Retractions)
    """Of the log."""

    reason = TrimReason.REDACTED
    horizon = 0
    always_has_horizon = False

    @classmethod
    def of(cls, log: Path | LogReader, parts: Sequence[Part], before: int) -> Redaction:
        """Return what is redacted in the events of a log below a number.

        Raises:
            LogError: What makes an object what it is: without that, it would be a door.
        """
        reader = log if isinstance(log, LogReader) else LogReader(log)
        kept = [p for p in parts if isinstance(p, Annotation) and p.key in (CLASS, OUTLINE)]
        defining = Window(kinds=kinds_mask([ClassDefined]))
        if kept and any(len(batch) for batch in reader.batches(defining)):
            raise LogError(
                f"{reader.folder}: {kept[0].words} say what it is and where, and stay; without "
                "them it would be taken for a door."
            )
        meant = {(p.door_id, p.key) for p in parts if isinstance(p, Annotation)}
        window = Window(first_event=before, kinds=kinds_mask([DoorAnnotated]))
        later = [
            (one.number, replace(one.event, happened_ns=min(one.happened_ns, one.recorded_ns)))
            for batch in (reader.batches(window) if meant else ())
            for one in batch
            if isinstance(one.event, DoorAnnotated) and (one.event.door_id, one.event.key) in meant
        ]
        return cls(parts, before, tuple(pins(reader).values()), later, reader.retractions())

    @property
    def words(self) -> str:
        """What goes, for the log's own history."""
        return ", ".join(part.words for part in self.parts)

    def recorded_before(self) -> list[Event]:
        """Return the pins without the texts that go."""
        return [self._redacted(pin) for pin in self.pins] if self._annotations else []

    def _redacted(self, pin: MomentPinned) -> MomentPinned:
        state = unpacked(pin.keyframe)
        if state is None:
            return replace(pin, keyframe="", next_event=0)
        self._forget(state, pin.next_event - 1, pin.at_ns)
        return with_state(pin, state, pin.next_event)

    def _forget(self, state: DoorMapState, known: int, at_ns: int = MAX_TIME_NS) -> None:
        """Take texts out of a state, which may bring others back.

        Args:
            state: The state.
            known: The last event that was known to it.
            at_ns: When it was.
        """
        for part in self._annotations:
            state.forget_text(part.door_id, part.key, self.before)
        retractions = self.retractions.up_to(known)
        for number, event in self.later:
            is_there = number <= known and retractions.first_hiding(number) is None
            if is_there and (event.happened_ns or 0) <= at_ns:
                state.apply_one(event, number)

    def select(self, segment: Segment) -> Redaction | None:
        """Return what is to be taken out of a segment; None: nothing that could be there."""
        kinds = int(np.bitwise_or.reduce(segment.chunks.rows["kinds"], initial=0))
        if not any(part.bits & kinds for part in self.parts):
            return None
        is_behind = segment.header.first_event >= self.before
        return None if is_behind and not self._annotations else self

    def gone(self, page: Page) -> NDArray[np.bool_]:
        """As `Selection` says."""
        found = np.zeros(len(page.heads), np.bool_)
        for part in self.parts:
            found |= part.gone(page)
        return found & (page.numbers(np.arange(len(found))) < self.before)

    def keyframe(self, data: bytes) -> bytes | None:
        """As `Selection` says: without the texts that go."""
        if not self._annotations:
            return data
        state = keyframes.decode(data)
        if state is None:
            why = keyframes.why_unused(data)
            raise LogError(f"A keyframe cannot be read ({why}), so nothing can be taken out of it.")
        self._forget(state, state.event)
        return keyframes.encode(state)

    @property
    def _annotations(self) -> list[Annotation]:
        return [part for part in self.parts if isinstance(part, Annotation)]


def _actor_in(record: bytes | memoryview) -> str:
    said = read_message(type_name("CommitNote"), record[mcap.MESSAGE.size :])
    return str(said["actor"])
