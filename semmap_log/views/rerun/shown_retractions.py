"""What was taken back while a recording goes on: when that became known, and of which doors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from semmap_log.core.model.doors import DoorId
from semmap_log.log import Window
from semmap_log.views.excerpt.door_rows import RecordingEdge
from semmap_log.views.excerpt.span import Excerpt


@dataclass(frozen=True, slots=True)
class ShownRetraction:
    """A retraction."""

    edge: RecordingEdge
    """When it was recorded."""
    doors: frozenset[DoorId]
    """The doors of the events that it hides."""


def taken_back(excerpt: Excerpt) -> Iterator[ShownRetraction]:
    """Yield the retractions of door events along `recorded`, numbers ascending."""
    later = excerpt.retractions.after(excerpt.number_before())
    for number, (first, last) in zip(later.numbers, later.ranges, strict=True):
        recorded_ns = excerpt.log.event(number).recorded_ns
        if excerpt.until_ns is not None and recorded_ns >= excerpt.until_ns:
            return
        if doors := _doors(excerpt, first, min(last, number - 1)):
            yield ShownRetraction(RecordingEdge(recorded_ns, number, recorded_ns), doors)


def _doors(excerpt: Excerpt, first: int, last: int) -> frozenset[DoorId]:
    """Return the doors of the excerpt that the events of these numbers are about."""
    window = Window(first_event=first, before_event=last + 1)
    found: set[int] = set()
    for batch in excerpt.log.batches_in(window):
        found.update(batch.door_ids()[batch.about_doors()].tolist())
    chosen = found if excerpt.doors is None else found & excerpt.doors
    return frozenset(DoorId(door_id) for door_id in chosen)
