"""What can be taken back of a log, and what a retraction did."""

from __future__ import annotations

from collections.abc import Iterator

from semmap_log.domain.events import Retracted
from semmap_log.errors import CommandError
from semmap_log.folds.history import HistoryEntry, history
from semmap_log.replay.position import NO_EVENT, Retraction, hiding, retractions_behind
from semmap_log.store.reading.commit_finder import CommitFinder
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window


def check_can_retract(reader: LogReader, first: int, last: int) -> None:
    """Return if a range holds events, one of them at least not hidden yet, and no retraction.

    Args:
        reader: Of the log.
        first: Number of the first event.
        last: Number of the last, inclusive.

    Raises:
        CommandError: It does not; the message says what is there instead.
    """
    what = f"event {first}" if first == last else f"events {first}..{last}"
    if last < first:
        raise CommandError(f"cannot retract {what}: the range runs backwards; swap the two.")
    commit = reader.last_commit()
    end = NO_EVENT if commit is None else commit.last_event
    if first < 0 or last > end:
        there = "the log holds none yet" if end == NO_EVENT else f"the log holds 0..{end}"
        raise CommandError(f"cannot retract {what}: {there}.")
    known = retractions_behind(reader, NO_EVENT)
    if next(_newly_hidden(first, last, known, known), None) is not None:
        return
    own = [one.number for one in known if first <= one.number <= last]
    if own:
        raise CommandError(
            f"cannot retract {what}: event {own[0]} is itself a retraction, which cannot be taken "
            "back; record again what is true."
        )
    by = next(one.number for one in known if one.first_event <= first <= one.last_event)
    raise CommandError(f"cannot retract {what}: taken back already, by event {by}.")


def newly_hidden(reader: LogReader, number: int) -> Iterator[HistoryEntry]:
    """Yield the events that the retraction of that number hid, and none before it had.

    Raises:
        LogError: There is no such event.
    """
    event = reader.event(number).event
    assert isinstance(event, Retracted)
    known = retractions_behind(reader, NO_EVENT, number)
    earlier = tuple(one for one in known if one.number < number)
    hidden = hiding(known)
    finder = CommitFinder(reader)
    for first, last in _newly_hidden(event.first_event, event.last_event, earlier, known):
        window = Window(first_event=first, before_event=last + 1)
        batches = reader.batches(window, on_page=finder.look_at)
        yield from history(batches, finder.commit_at, hidden)


def _newly_hidden(
    first: int, last: int, earlier: tuple[Retraction, ...], retractions: tuple[Retraction, ...]
) -> Iterator[tuple[int, int]]:
    """Yield what is left of a range without what was hidden earlier, and without retractions."""
    gaps = [(one.first_event, one.last_event) for one in earlier]
    gaps += [(one.number, one.number) for one in retractions]
    for gap_first, gap_last in sorted(gaps):
        if gap_first > first:
            yield first, min(gap_first - 1, last)
        first = max(first, gap_last + 1)
        if first > last:
            return
    yield first, last
