"""Log + a moment -> the events that count, and the door map."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.io.progress import Progress
from semmap_log.log.replay.state import state_at
from semmap_log.store.reading.reader import LogReader, OnPage
from semmap_log.store.reading.window import Window


@dataclass(frozen=True, slots=True)
class Scope:
    """Which events count. Every bound is inclusive; None: no bound."""

    at_ns: int | None = None
    """Happened by then: what was true, with all that is known."""
    known_at_ns: int | None = None
    """Recorded by then, whole commits: what was known. With `at_ns`: bitemporal."""
    event: int | None = None
    """Up to that event number."""

    def limit(self, reader: LogReader) -> int | None:
        """Return the greatest event number that counts; None: all."""
        limits = [] if self.event is None else [self.event]
        if self.known_at_ns is not None:
            limits.append(reader.event_known_at(self.known_at_ns))
        return min(limits, default=None)


def replay(
    reader: LogReader,
    scope: Scope = Scope(),
    *,
    progress: Progress | None = None,
    with_newer: bool = False,
) -> DoorMapState:
    """Return the door map of a scope, from the nearest keyframe.

    Args:
        reader: Of the log.
        scope: Which events count.
        progress: Told how far the reading is.
        with_newer: Even where an event of an unknown kind may have changed it.

    Raises:
        NewerLogError: There is such an event.
    """
    return state_at(
        reader,
        at_ns=scope.at_ns,
        limit=scope.limit(reader),
        progress=progress,
        with_newer=with_newer,
    )


def visible_batches(
    reader: LogReader,
    scope: Scope = Scope(),
    *,
    progress: Progress | None = None,
    on_page: OnPage | None = None,
    doors: Collection[int] | None = None,
) -> Iterator[EventBatch]:
    """Yield the events of a scope, without those retracted by what is known in it.

    Args:
        reader: Of the log.
        scope: Which events count.
        progress: Told how far the reading is.
        on_page: Called with the records of each batch that comes from the log itself.
        doors: Only events about these; None: all.
    """
    from semmap_log.log.replay.read_model.events_about import events_about

    limit = scope.limit(reader)
    if limit is not None and limit < 0:
        return
    retractions = reader.retractions(limit=limit)
    window = Window.up_to(at_ns=scope.at_ns, event=limit)
    before: Iterable[EventBatch] = ()
    if reader.horizon:
        from semmap_log.log.replay.state import events_at_horizon

        reader.check_horizon(window)
        before = events_at_horizon(reader, window, doors)
        window = replace(window, first_event=reader.horizon)
    found = events_about(reader, window, doors, progress=progress, on_page=on_page)
    for batch in chain(before, found):
        visible = retractions.visible(batch)
        if len(visible):
            yield visible
