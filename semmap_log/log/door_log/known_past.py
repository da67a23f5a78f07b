"""What a trimmed log no longer knows of its past, and so can neither take back nor correct."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from weakref import WeakMethod

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.registers import writes_of
from semmap_log.core.folds.state_rows import COMES, state_rows
from semmap_log.core.folds.thinned_runs import HOUR_NS, ThinnedRun, ThinnedRuns
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import STATE_KINDS, SightingsThinned
from semmap_log.core.model.moments import format_local
from semmap_log.errors import CommandError
from semmap_log.log.door_log.retracting import check_can_retract
from semmap_log.store.kind_bits import bits_of_kinds
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window


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
