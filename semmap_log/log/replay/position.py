"""How far a fold has come in a log, and whether that is still a place in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.batches.retraction import Retractions
from semmap_log.core.io.progress import Progress
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.events import HistoryTrimmed, Retracted
from semmap_log.store.header import TrimReason
from semmap_log.store.kind_bits import EVENT_BITS, bits_of_kinds
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window

NO_EVENT = -1
_REDACTED = str(TrimReason.REDACTED.name).lower()


class Retraction(NamedTuple):
    """A Retracted event: its number, and the range that it hides."""

    number: int
    first_event: int
    last_event: int


@dataclass(frozen=True, slots=True)
class Position:
    """The end of a whole commit, up to which events were taken in; by number, never by time."""

    event: int = NO_EVENT
    """The last event of the commit; -1: the log's beginning."""
    commit_hash: bytes = bytes(32)
    """Of the commit: by the chain of hashes, of everything before it, too."""
    latest_ns: int = 0
    """The latest time by which an event that was taken in is ordered."""
    retractions: tuple[Retraction, ...] = ()
    """Those recorded so far, so that what they hide was left out."""

    def is_in(self, reader: LogReader) -> bool:
        """Tell whether the log, as it is now, has come by here."""
        if self.event == NO_EVENT:
            return True
        commit = reader.find_commit(self.event)
        return commit is not None and (commit.last_event, commit.hash) == (
            self.event,
            self.commit_hash,
        )

    def is_before_redaction(self, reader: LogReader) -> bool:
        """Tell whether something was redacted since: what was taken in may tell it."""
        if self.event == NO_EVENT:
            return False
        own = f"{reader.info.log_id}:"
        told = (
            one.event
            for batch in reader.batches(_behind(self.event, None, bits_of_kinds([HistoryTrimmed])))
            for one in batch
        )
        return any(
            isinstance(event, HistoryTrimmed)
            and event.tombstones.startswith(own)
            and _REDACTED in event.reasons.split(", ")
            for event in told
        )

    def is_touched_by(self, later: Iterable[Retraction]) -> bool:
        """Tell whether one of these retractions hides an event that was taken in."""
        return any(
            one.first_event <= self.event and not self._leaves_out(one)
            for one in later
            if one.number > self.event
        )

    def is_before_horizon(self, reader: LogReader) -> bool:
        """Tell whether events that come next are gone for their age."""
        return NO_EVENT < self.event < reader.horizon - 1

    def _leaves_out(self, later: Retraction) -> bool:
        """Tell whether an earlier retraction hides all of it that was taken in."""
        last = min(later.last_event, self.event)
        return any(
            one.first_event <= later.first_event and last <= one.last_event
            for one in self.retractions
        )


def retractions_behind(
    reader: LogReader, event: int, limit: int | None = None
) -> tuple[Retraction, ...]:
    """Return the retractions with numbers behind `event`, and up to `limit`.

    Raises:
        NewerLogError: An event of an unknown kind may have taken back others, too.
    """
    reader.check_known(limit)
    found = Retractions()
    for batch in reader.batches(_behind(event, limit, bits_of_kinds([Retracted]))):
        found.apply(batch)
    pairs = zip(found.numbers, found.ranges, strict=True)
    return tuple(Retraction(number, *hidden) for number, hidden in pairs)


def hiding(retractions: Iterable[Retraction]) -> Retractions:
    """Return what leaves out the events that these retractions hide."""
    hidden = Retractions()
    for one in retractions:
        hidden.numbers.append(one.number)
        hidden.ranges.append((one.first_event, one.last_event))
    return hidden


def events_behind(
    reader: LogReader,
    event: int,
    limit: int | None = None,
    *,
    at_ns: int | None = None,
    progress: Progress | None = None,
) -> Iterator[EventBatch]:
    """Yield all events with numbers behind `event`, and up to `limit`, retracted ones included.

    From a log's beginning on, what stands for the events before its horizon comes first.

    Args:
        reader: Of the log.
        event: The number; -1: from the beginning on.
        limit: The last event; None: the log's.
        at_ns: Those that happened later are not needed; None: all are.
        progress: Told how far the reading is.

    Raises:
        CorruptLogError: A chunk is not what was written, or events are missing.
        HorizonError: The limit, or the moment, is before the horizon.
    """
    if event == NO_EVENT and reader.horizon:
        from semmap_log.log.replay.horizon import events_at_horizon

        window = Window.up_to(at_ns=at_ns, event=limit)
        reader.check_horizon(window)
        yield from events_at_horizon(reader, window, None)
        event = reader.horizon - 1
    yield from reader.batches(_behind(event, limit), progress=progress)


def _behind(event: int, limit: int | None, kinds: int = EVENT_BITS) -> Window:
    return Window(
        first_event=event + 1, before_event=None if limit is None else limit + 1, kinds=kinds
    )
