"""A log without poses, and without sightings of old segments that repeat others.

Of sightings of a door that follow each other in one hour and say the same, the first and the last
stay. So the state at every moment is what it was, as is what was known at every moment: a sighting
goes only if the first of them was known before it. For each run of them, an event states how many
went and what their sensors were worth; beliefs rest on it from then on. What is lost: when exactly
within an hour a door was looked at again, by which of several sensors of the same accuracy, and up
to an hour of its `last_seen` at moments of that time. Doors for which something was retracted there
keep all their sightings.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.registers import state_rows
from semmap_log.core.folds.thinned_runs import HOUR_NS
from semmap_log.core.model import events
from semmap_log.core.model.moments import format_second
from semmap_log.log.replay import keyframes
from semmap_log.store.header import TrimReason
from semmap_log.store.pages import Page, bits_of_counts, kinds_mask
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import end_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import Window

EVENTS_AT_ONCE = 100_000
"""About so many are looked at together; all of one hour always are."""
_GOING = kinds_mask([events.DoorObserved, events.RobotPose])


class Thinning:
    """What goes of all that was recorded before a moment."""

    reason = TrimReason.THINNED
    horizon = 0
    always_has_horizon = False

    def __init__(self, log: Path | LogReader, until_ns: int) -> None:
        """Look how far the log is thinned.

        Args:
            log: Its folder; or what reads it.
            until_ns: What was recorded before this moment may go.
        """
        reader = self._reader = log if isinstance(log, LogReader) else LogReader(log)
        self._until_ns = until_ns
        self.before = reader.event_known_at(max(until_ns, reader.horizon_ns)) + 1
        """Number of the first event that stays."""
        self._goes = np.zeros(self.before // 8 + 1, np.uint8)
        """A bit for each number of an event: whether it is a sighting that repeats others."""
        self._known: set[int] = set()
        """The segments whose events were examined, by the number of their first event."""

    @property
    def words(self) -> str:
        """What goes, for the log's own history."""
        until = format_second(self._until_ns)
        return f"repeated sightings and poses that were recorded before {until}"

    def recorded_before(self) -> Iterator[events.Event | EventBatch]:
        """Yield what the sightings that go were worth: what is believed of doors rests on it.

        Reports of a thinning that was stopped before the sightings went are retracted.
        """
        for segment in self._reader.segments:
            if self._concerns(segment):
                yield from (_worth(some) for some in self._look_at(segment) if len(some))
        for number in self._stopped_reports():
            yield events.Retracted(first_event=number, last_event=number)

    def select(self, segment: Segment) -> Thinning | None:
        """Return what goes of a segment; None: nothing that could be there."""
        if not self._concerns(segment):
            return None
        if segment.header.first_event not in self._known:
            for _ in self._look_at(segment):
                pass
        return self

    def gone(self, page: Page) -> NDArray[np.bool_]:
        """As `Selection` says."""
        numbers, channels = page.numbers(np.arange(len(page.heads))), page.heads["channel_id"]
        found = np.asarray(channels == events.RobotPose.kind) & (numbers < self.before)
        found[channels == events.DoorObserved.kind] = self._going(
            numbers[channels == events.DoorObserved.kind]
        )
        return found

    def keyframe(self, data: bytes) -> bytes | None:
        """As `Selection` says: those within know of sightings that go."""
        event = keyframes.event_of(data)
        return None if event is None or event < self.before else data

    def _concerns(self, segment: Segment) -> bool:
        """Return whether some of it may go; the live one is closed before anything does."""
        if segment.header.first_event >= self.before or segment.told is not None:
            return False
        if segment.counts is not None:
            return bool(bits_of_counts(segment.counts) & _GOING)
        return len(segment.chunks.having(_GOING)) > 0

    def _look_at(self, segment: Segment) -> Iterator[NDArray[np.void]]:
        """Yield what goes of a segment's sightings, as `repeats_in`, and remember it."""
        for repeats in repeats_in(self._reader, segment):
            going = repeats[repeats["number"] < self.before]
            places, bits = np.divmod(going["number"], 8)
            np.bitwise_or.at(self._goes, places, np.uint8(1) << bits.astype(np.uint8))
            yield going
        self._known.add(segment.header.first_event)

    def _going(self, numbers: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which events are sightings that go."""
        is_old = numbers < self.before
        old = np.where(is_old, numbers, 0)
        bits: NDArray[np.bool_] = (self._goes[old // 8] >> (old % 8).astype(np.uint8)) % 2 > 0
        return bits & is_old

    def _stopped_reports(self) -> Iterator[int]:
        """Yield the numbers of events that report sightings which still exist, and go now."""
        reader, hidden = self._reader, self._reader.retractions()
        kept = Window(
            kinds=kinds_mask([events.SightingsThinned]), first_event=reader.horizon or None
        )
        for batch in reader.batches(kept):
            told = hidden.visible(batch)
            if len(told):
                again = self._going(told[events.SightingsThinned]["first_event"].astype(np.int64))
                yield from told.number[again].tolist()


def _worth(repeats: NDArray[np.void]) -> EventBatch:
    """Return how many sightings go of each run, and when they were."""
    starts = np.flatnonzero(np.diff(repeats["run"], prepend=-1))
    counts = np.diff(np.append(starts, len(repeats)))
    ends = starts + counts - 1
    return EventBatch.of(
        events.SightingsThinned,
        door_id=repeats["door_id"][starts],
        state=repeats["state"][starts],
        count=counts,
        accuracy_open=np.add.reduceat(repeats["accuracy_open"], starts) / counts,
        accuracy_closed=np.add.reduceat(repeats["accuracy_closed"], starts) / counts,
        first_ns=repeats["folds_ns"][starts],
        last_ns=repeats["folds_ns"][ends],
        first_event=repeats["number"][starts],
        happened_ns=repeats["folds_ns"][ends],
    )


def repeats_in(reader: LogReader, segment: Segment) -> Iterator[NDArray[np.void]]:
    """Yield the sightings of a segment that repeat others, some hours at a time, as `STATE_ROW`.

    All reports of the doors' states in the same span of time are looked at, in whatever
    segment it is. Those of some hours come by door and time. What happened before the log's horizon
    stays: a pinned moment of that time may lie between two sightings that others, which are gone,
    had lain between.
    """
    least, greatest = segment.span
    span = Window(
        happened_from_ns=least,
        happened_before_ns=greatest + 1,
        first_event=reader.horizon or None,
        kinds=kinds_mask(events.STATE_KINDS),
    )
    cuts, touched = _first_look(reader, span)
    for first_ns, before_ns in pairwise([least, *cuts, greatest + 1]):
        hours = replace(span, happened_from_ns=first_ns, happened_before_ns=before_ns)
        repeats = _repeats_among(state_rows(reader.batches(hours)))
        mine = repeats["number"] >= segment.header.first_event
        mine &= repeats["number"] < end_of(segment)
        mine &= repeats["folds_ns"] > reader.horizon_ns
        yield repeats[mine & ~np.isin(repeats["door_id"], touched)]


def _first_look(reader: LogReader, span: Window) -> tuple[list[int], list[int]]:
    """Return where a window is cut, and the doors of whose states something was taken back there.

    It is cut where hours begin, so that about `EVENTS_AT_ONCE` happened between two cuts.
    """
    hidden, touched, counts = reader.retractions(), set[int](), Counter[int]()
    for batch in reader.batches(span):
        counts.update((batch.folds_ns // HOUR_NS).tolist())
        if hidden:
            rows = state_rows([batch.select(hidden.hidden(batch))])
            touched.update(rows["door_id"].tolist())
    hours = np.array(sorted(counts), np.int64)
    parts = np.cumsum([counts[hour] for hour in hours.tolist()]) // EVENTS_AT_ONCE
    cuts: list[int] = (hours[1:][np.diff(parts) > 0] * HOUR_NS).tolist()
    return cuts, sorted(touched)


def _repeats_among(rows: NDArray[np.void]) -> NDArray[np.void]:
    """Return the sightings among such rows that repeat others, by door and time."""
    rows = rows[np.lexsort((rows["number"], rows["folds_ns"], rows["door_id"]))]
    alike = np.ones(len(rows), np.bool_)
    for column in (rows["door_id"], rows["state"], rows["folds_ns"] // HOUR_NS):
        alike[1:] &= column[1:] == column[:-1]
    alike[:1] = False  # as the row before
    rows["run"] = np.cumsum(~alike)
    if not len(rows):
        return rows
    was_known = rows["number"] > rows["number"][~alike][rows["run"] - 1]
    is_within = alike & np.append(alike[1:], False) & was_known
    repeats: NDArray[np.void] = rows[is_within & rows["is_sighting"]]
    return repeats
