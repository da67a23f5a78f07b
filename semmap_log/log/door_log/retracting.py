"""What can be taken back of a log, and what a retraction did."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from semmap_log.core.folds.history import HistoryEntry, history
from semmap_log.core.model.events import Retracted
from semmap_log.errors import CommandError
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window

if TYPE_CHECKING:
    from semmap_log.core.batches.retraction import Retractions
    from semmap_log.log.door_log.door_log import DoorLog


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
