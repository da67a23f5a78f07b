"""Who changed what, when, why: events side by side with the notes of their commits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

from semmap_log.batches.event_batch import EventBatch, RecordedEvent
from semmap_log.batches.retraction import Retractions
from semmap_log.common.shown_as_table import ShownAsTable
from semmap_log.domain.commits import Note
from semmap_log.domain.doors import DoorId
from semmap_log.domain.events import DoorEvent, Event
from semmap_log.folds.value_changes import Changes, ValueChange


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


class Said(Protocol):
    """What a commit says of its events."""

    @property
    def note(self) -> Note: ...  # noqa: D102
    @property
    def command_id(self) -> bytes: ...  # noqa: D102


def history(
    batches: Iterable[EventBatch],
    commit_at: Callable[[int], Said],
    retractions: Retractions,
    changes_in: Callable[[EventBatch], Changes] | None = None,
) -> Iterator[HistoryEntry]:
    """Yield the events of the batches with what their commits say.

    Args:
        batches: Events, numbers ascending; gaps allowed.
        commit_at: Returns the commit that holds the event of a number.
        retractions: What is hidden; it is shown here, and marked.
        changes_in: Returns what the events of a batch changed; None: that is not told.
    """
    for batch in batches:
        changes = changes_in(batch) if changes_in is not None else {}
        hidden = retractions.hidden(batch).tolist()
        for recorded, is_hidden in zip(batch, hidden, strict=True):
            commit = commit_at(recorded.number)
            note = commit.note
            yield HistoryEntry(
                number=recorded.number,
                event=recorded.event,
                happened_ns=recorded.happened_ns,
                recorded_ns=recorded.recorded_ns,
                actor=note.actor,
                source=note.source,
                reason=note.reason,
                correlation=note.correlation,
                command_id=commit.command_id,
                retracted=is_hidden,
                retracted_by=retractions.first_hiding(recorded.number) if is_hidden else None,
                changes=changes.get(recorded.number, ()),
            )
