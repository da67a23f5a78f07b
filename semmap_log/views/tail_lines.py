"""Events as lines, one an event, for who watches a log grow: people, or programs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

from semmap_log.core.batches.event_batch import RecordedEvent
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorEvent
from semmap_log.core.model.moments import format_local
from semmap_log.views.event_words import printable, words_of
from semmap_log.views.tables import ABSENT, NO_OBJECTS, Objects, class_in

DOOR_WIDTH = 14
NUMBER_WIDTH = 6
GAP = "  "
UNBOUNDED = 2**30
LATE_NS = 60 * 10**9
"""An event that was recorded at least so late shows its delay."""

ROW = ("event", "happened", "recorded", "kind", "door_id", "door", "what",
       "actor", "source", "reason")  # fmt: skip
"""The columns of `event_row`, for programs, and of a history."""


def event_row(
    recorded: RecordedEvent,
    *,
    tz: str,
    names: Mapping[DoorId, str],
    objects: Objects = NO_OBJECTS,
    note: Note = Note(),
) -> tuple[str, ...]:
    """Return an event as the cells of `ROW`; arguments are those of `event_line`."""
    event = recorded.event
    door_id = event.door_id if isinstance(event, DoorEvent) else None
    return (
        str(recorded.number),
        format_local(recorded.happened_ns, tz),
        format_local(recorded.recorded_ns, tz),
        type(event).__name__,
        ABSENT if door_id is None else str(door_id),
        ABSENT if door_id is None else names.get(door_id, str(door_id)),
        words_of(event, class_in(objects, door_id)),
        *(text or ABSENT for text in (note.actor, note.source, note.reason)),
    )


def event_line(
    recorded: RecordedEvent,
    *,
    tz: str,
    names: Mapping[DoorId, str],
    objects: Objects = NO_OBJECTS,
    note: Note = Note(),
    width: int = UNBOUNDED,
) -> str:
    """Return an event as a line: number, when it happened, door, what, who and why.

    Args:
        recorded: The event.
        tz: IANA zone of the times.
        names: The doors' names; a door without one is shown by its number.
        objects: The classes of objects that are not doors.
        note: The note of its commit.
        width: Of the terminal: longer lines continue in indented ones.
    """
    event = recorded.event
    door_id = event.door_id if isinstance(event, DoorEvent) else None
    door = "" if door_id is None else names.get(door_id, str(door_id))
    parts = [
        f"{recorded.number:>{NUMBER_WIDTH}}",
        format_local(recorded.happened_ns, tz),
        _padded(printable(door), DOOR_WIDTH),
        printable(words_of(event, class_in(objects, door_id))),
    ]
    if recorded.recorded_ns - recorded.happened_ns > LATE_NS:
        parts.append(f"(recorded {format_local(recorded.recorded_ns, tz)})")
    said = ": ".join(text for text in (note.actor, note.reason) if text)
    if said:
        parts.append(f"[{printable(said)}]")
    return "\n".join(_lines(parts, width))


def _padded(text: str, width: int) -> str:
    return text + " " * (width - cell_len(text))


def _lines(parts: Sequence[str], width: int) -> Iterator[str]:
    """Yield lines of parts, as many in each as fit; a longer part is folded."""
    indent = " " * min(NUMBER_WIDTH + len(GAP), width // 5)
    line, *others = parts
    for part in others:
        longer = f"{line}{GAP}{part}"
        if cell_len(longer.rstrip()) <= width:
            line = longer
            continue
        yield line.rstrip()
        *whole, last = _folded(part.strip(), width - len(indent))
        yield from (f"{indent}{each}" for each in whole)
        line = f"{indent}{last}"
    yield line.rstrip()


def _folded(text: str, width: int) -> list[str]:
    """Return a text in lines of that width, broken at spaces; at least one line."""
    if cell_len(text) <= width:
        return [text]
    lines = Text(text).wrap(Console(width=width), max(width, 1), overflow="fold")
    return [line.plain.rstrip() for line in lines]
