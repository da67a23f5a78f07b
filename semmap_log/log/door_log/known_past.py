"""What a trimmed log no longer knows of its past, and so can neither take back nor correct.

What can be taken back of a log, and what a retraction did.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cached_property
from typing import TYPE_CHECKING
from weakref import WeakMethod

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.history import HistoryEntry, history
from semmap_log.core.folds.registers import COMES, state_rows, writes_of
from semmap_log.core.folds.thinned_runs import HOUR_NS, ThinnedRun, ThinnedRuns
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import STATE_KINDS, Retracted, SightingsThinned
from semmap_log.core.model.moments import format_local
from semmap_log.errors import CommandError
from semmap_log.store.kind_bits import bits_of_kinds
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window

if TYPE_CHECKING:
    from semmap_log.core.batches.retraction import Retractions
    from semmap_log.log.door_log.door_log import DoorLog


class KnownPast:
    """Checks what new events say of the past against what the log still holds of it.

    Thinned sightings are those that it holds when it is asked first: only the writer's lock lets
    anybody thin a log.
    """

    def __init__(self, get_reader: WeakMethod[Callable[[], LogReader]]) -> None:
        """Prepare; nothing is read.

        Args:
            get_reader: Returns a reader of the log as it is now.
        """
        self._get_reader = get_reader
        self._starts: dict[ThinnedRun, int] = {}

    @property
    def whole_from(self) -> int:
        """Number of the first event after all segments from which something was taken out."""
        headers = (segment.header for segment in self._reader().segments)
        return max((h.trimmed.next_event for h in headers if h.trimmed is not None), default=0)

    def check_retraction(
        self, first: int, last: int, *, own: range = range(0), are_facts: bool = False
    ) -> None:
        """Check that events can be taken back; as `check_can_retract`."""
        check_can_retract(self._reader(), first, last, own=own, are_facts=are_facts)

    def is_late(self, at_ns: int) -> bool:
        """Tell whether a time is earlier than the last sighting that was thinned."""
        return at_ns < self._thinned_until_ns

    def check_late(self, batch: EventBatch) -> None:
        """Check that no event sets a state between sightings of another state that are gone.

        Until when it would hold is not known: until the next sighting, and that is gone.

        Args:
            batch: Events that are about to be appended, with the times they are given.

        Raises:
            CommandError: One does.
        """
        times = batch.happened_ns
        is_late = (times >= 0) & (times < self._thinned_until_ns)
        if not is_late.any():
            return
        for writes in writes_of(batch):
            if writes.register != "state":
                continue
            late = np.flatnonzero(is_late[writes.positions])
            states = writes.values_of(late)["state"].tolist()
            places = writes.positions[late]
            rows = zip(batch.door_ids()[places].tolist(), times[places].tolist(), states,
                       strict=True)  # fmt: skip
            for door_id, at_ns, state in rows:
                self._check_state(door_id, at_ns, state)

    def _check_state(self, door_id: int, at_ns: int, state: int) -> None:
        for run in self._thinned.around(door_id, at_ns):
            if run.state != state and at_ns >= self._start_of(run):
                raise self._refusal(run, at_ns, state)

    def _start_of(self, run: ThinnedRun) -> int:
        """Return when the sighting before a run happened: the last that is left."""
        if run not in self._starts:
            begin_ns = run.first_ns // HOUR_NS * HOUR_NS
            reader = self._reader()
            window = Window(
                happened_from_ns=begin_ns,
                happened_before_ns=run.first_ns + 1,
                first_event=reader.horizon or None,
                kinds=bits_of_kinds(STATE_KINDS),
            )
            hidden = reader.retractions()
            rows = state_rows(map(hidden.visible, reader.batches(window, doors=[run.door_id])))
            is_state = (rows["door_id"] == run.door_id) & (rows["state"] < COMES)
            start_ns = int(rows["folds_ns"][is_state].max(initial=begin_ns))
            self._starts[run] = start_ns
        return self._starts[run]

    def _reader(self) -> LogReader:
        get_reader = self._get_reader()
        assert get_reader is not None, "who checks holds the map"
        return get_reader()

    @cached_property
    def _thinned_until_ns(self) -> int:
        return self._thinned.until_ns

    @cached_property
    def _thinned(self) -> ThinnedRuns:
        reader, found = self._reader(), ThinnedRuns()
        hidden = reader.retractions()
        kept = Window(kinds=bits_of_kinds([SightingsThinned]), first_event=reader.horizon or None)
        for batch in reader.batches(kept):
            found.apply(hidden.visible(batch))
        return found

    def _refusal(self, run: ThinnedRun, at_ns: int, state: int) -> CommandError:
        tz = self._reader().info.timezone
        at, start, last = (format_local(ns, tz) for ns in (at_ns, self._start_of(run), run.last_ns))
        was, said = DoorState(run.state).name, DoorState(state).name
        return CommandError(
            f"door {run.door_id} cannot have been {said} at {at}: the sightings of it as {was} "
            f"from {start} to {last} were thinned (retain --thin), so how long it was {said} would "
            "not be known. Give a time outside of that span, or annotate the door."
        )


def check_can_retract(
    reader: LogReader, first: int, last: int, *, own: range, are_facts: bool = False
) -> None:
    """Check that events can be taken back: they are there, and at least one of them still counts.

    Args:
        reader: Of the log.
        first: Number of the first event.
        last: Number of the last, inclusive.
        own: Numbers of the earlier events of its own commit, which can be taken back, too.
        are_facts: Another log took the retraction: it may hide nothing new.

    Raises:
        CommandError: They cannot; the message says what is there instead.
    """
    what = f"event {first}" if first == last else f"events {first}..{last}"
    if last < first:
        raise CommandError(f"cannot retract {what}: the range runs backwards; swap the two.")
    end = own.stop - 1 if last in own else reader.last_event()
    if first < 0 or last > end:
        there = "the log holds none yet" if end < 0 else f"the log holds 0..{end}"
        raise CommandError(f"cannot retract {what}: {there}.")
    if first < (whole := reader.first_whole_event):
        raise CommandError(
            f"cannot retract {what}: what was before event {whole} is no longer kept in full "
            "(retain), so what would be true without that is not known; record again what is true."
        )
    if are_facts:
        return
    known = reader.retractions()
    if next(_newly_hidden(first, last, known, known.numbers), None) is not None:
        return
    inside = [number for number in known.numbers if first <= number <= last]
    if inside:
        raise CommandError(
            f"cannot retract {what}: event {inside[0]} is itself a retraction, which cannot be "
            "taken back; record again what is true."
        )
    if first == last and not any(
        known.hidden(b).any()
        for b in reader.batches(Window(first_event=first, before_event=first + 1))
    ):
        return  # it tells of the log: no range has hidden it
    by = known.first_hiding(first)
    raise CommandError(f"cannot retract {what}: taken back already, by event {by}.")


def newly_hidden(log: DoorLog, number: int) -> Iterator[HistoryEntry]:
    """Yield the events that the retraction of that number hid, and none before it had.

    Raises:
        LogError: There is no such event.
    """
    event = log.event(number).event
    assert isinstance(event, Retracted)
    hidden = log.retractions(limit=number)
    finder = log.said_finder()
    earlier = hidden.up_to(number - 1)
    for first, last in _newly_hidden(event.first_event, event.last_event, earlier, hidden.numbers):
        window = Window(first_event=first, before_event=last + 1)
        batches = log.batches_in(window, on_page=finder.look_at)
        yield from history(batches, finder.said_of, hidden)


def _newly_hidden(
    first: int, last: int, earlier: Retractions, retractions: Iterable[int]
) -> Iterator[tuple[int, int]]:
    """Yield what is left of a range without what was hidden earlier, and without retractions."""
    gaps = [*earlier.ranges, *((number, number) for number in retractions)]
    for gap_first, gap_last in sorted(gaps):
        if gap_first > first:
            yield first, min(gap_first - 1, last)
        first = max(first, gap_last + 1)
        if first > last:
            return
    yield first, last
