"""What a commit tells of doors before they were added."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.early_events import MAY_BE_EARLY, Addings, EarlyEvents
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model.events import Event


class EarlyCounter:
    """Counts the events of one commit that had happened before their door was added."""

    def __init__(self, now_ns: Callable[[], int] | None) -> None:
        """Begin with none.

        Args:
            now_ns: The log's clock, by which events without a time happen; None: not known.
        """
        self._now_ns = now_ns
        self._began_ns: int | None = None
        """What the clock said when it was first asked."""
        self.found = EarlyEvents.none()

    def note(self, event: Event, added_ns: Mapping[int, int]) -> None:
        """Count an event that passed if it had happened before its door was added.

        Args:
            event: The event.
            added_ns: When each door was added; a time at the end of time: not known yet.
        """
        if not isinstance(event, MAY_BE_EARLY) or event.happened_ns is None:
            return
        since_ns = added_ns.get(event.door_id, 0)
        if event.happened_ns < since_ns and event.happened_ns < self._since_ns(since_ns):
            self.found.add(event.door_id, event.happened_ns)

    def note_rows(self, batch: EventBatch, added_ns: Mapping[int, int]) -> None:
        """Count those of a batch: as `note`."""
        if len(added_ns) > len(batch):  # only its own doors, or many small batches cost much
            mine = set(batch.door_ids().tolist())
            added_ns = {i: added_ns[i] for i in mine if i in added_ns}
        latest_ns = max(added_ns.values(), default=0)
        times = batch.happened_ns
        if not ((times >= 0) & (times < latest_ns)).any():
            return
        early = Addings.of({i: (ns, -1) for i, ns in added_ns.items()}).early(batch, times)
        timeless = [i for i, ns in added_ns.items() if ns == MAX_TIME_NS]
        unsure = early & np.isin(batch.door_ids(), timeless)
        if unsure.any():
            early &= ~unsure | (times < self._since_ns(MAX_TIME_NS))
        if early.any():
            self.found.add_rows(batch.door_ids()[early], times[early])

    def _since_ns(self, added_ns: int) -> int:
        """Return when a door was added; one that is added without a time: now."""
        if added_ns < MAX_TIME_NS:
            return added_ns
        if self._began_ns is None:
            self._began_ns = 0 if self._now_ns is None else self._now_ns()
        return self._began_ns
