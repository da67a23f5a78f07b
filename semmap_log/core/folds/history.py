"""Who changed what, when, why: events side by side with the notes of their commits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch, RecordedEvent
from semmap_log.core.batches.retraction import Retractions
from semmap_log.core.folds.value_changes import Changes, ValueChange
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.commits import NoteTexts
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorEvent, Event
from semmap_log.core.model.shown_as_table import ShownAsTable


@dataclass(frozen=True, slots=True)
class HistoryEntry(ShownAsTable):
    """One event, with who and why."""

    number: int
    event: Event
    happened_ns: int
    """As given; it may lie after `recorded_ns` if a clock was wrong."""
    recorded_ns: int
    actor: str = ""
    source: str = ""
    reason: str = ""
    correlation: str = ""
    command_id: bytes = b""
    retracted: bool = False
    retracted_by: int | None = None
    """The number of the first event that took it back; None: it stands."""
    changes: tuple[ValueChange, ...] = ()
    """What it changed in the map when it was recorded, where that was asked for."""

    @property
    def folds_ns(self) -> int:
        """When it counts: one that says it happened later than recorded counts as recorded."""
        return min(self.happened_ns, self.recorded_ns)

    @property
    def recorded(self) -> RecordedEvent:
        """The event without who and why."""
        return RecordedEvent(self.number, self.recorded_ns, self.event)

    @property
    def kind(self) -> str:
        """The event's kind, such as `DoorObserved`."""
        return type(self.event).__name__

    @property
    def door_id(self) -> DoorId | None:
        """The door it is about; None: about none."""
        return self.event.door_id if isinstance(self.event, DoorEvent) else None


SaidOf = Callable[[NDArray[np.int64]], Iterable[tuple[NoteTexts, bytes]]]
"""Event numbers, ascending -> of each who and why, and the id of its command."""


def history(
    batches: Iterable[EventBatch],
    said_of: SaidOf,
    retractions: Retractions,
    changes_in: Callable[[EventBatch], Changes] | None = None,
) -> Iterator[HistoryEntry]:
    """Yield the events of the batches with what their commits say.

    Args:
        batches: Events, numbers ascending; gaps allowed.
        said_of: Tells what the commits say; asked once a batch.
        retractions: What is hidden; it is shown here, and marked.
        changes_in: Returns what the events of a batch changed; None: that is not told.
    """
    for batch in batches:
        changes = changes_in(batch) if changes_in is not None else {}
        hidden = retractions.hidden(batch).tolist()
        said = said_of(batch.number)
        for recorded, is_hidden, (note, command_id) in zip(batch, hidden, said, strict=True):
            actor, source, reason, correlation = note
            yield HistoryEntry(
                number=recorded.number,
                event=recorded.event,
                happened_ns=recorded.happened_ns,
                recorded_ns=recorded.recorded_ns,
                actor=actor,
                source=source,
                reason=reason,
                correlation=correlation,
                command_id=command_id,
                retracted=is_hidden,
                retracted_by=retractions.first_hiding(recorded.number) if is_hidden else None,
                changes=changes.get(recorded.number, ()),
            )
