"""A log's events in the order in which they count, with who and why, in memory of a slice.

The log has them in the order of recording; late ones are put in their place slice by slice of
happened time. Only the times themselves, 8 bytes an event, are held all at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.retraction import Retractions
from semmap_log.core.folds.history import HistoryEntry, history
from semmap_log.core.io.progress import Progress
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.store.reading.window import Window

SLICE_EVENTS = 20_000

Times = NDArray[np.int64]
"""Nanoseconds, ascending, one for each event."""


def times_of(log: DoorLog, since_ns: int | None, until_ns: int | None) -> Times:
    """Return when the events of a range count, without retracted ones.

    Args:
        log: Where from.
        since_ns: From then on.
        until_ns: The last moment.
    """
    until = None if until_ns is None else until_ns + 1
    times = [np.empty(0, np.int64), *(batch.folds_ns for batch in log.batches(since_ns, until))]
    return np.sort(np.concatenate(times))


def moments(
    log: DoorLog, times: Times, progress: Progress | None = None
) -> Iterator[tuple[int, Sequence[HistoryEntry]]]:
    """Yield each moment at which something happened, and what did, in the order that counts.

    Args:
        log: Where from.
        times: `times_of` its range.
        progress: Told how many of the events are done.
    """
    done = 0
    starts = np.unique(times[::SLICE_EVENTS]).tolist()
    behind = int(times[-1]) + 1 if len(times) else 0
    for first_ns, before_ns in pairwise([*starts, behind]):
        entries = sorted(_slice(log, first_ns, before_ns), key=attrgetter("folds_ns", "number"))
        for at_ns, together in groupby(entries, attrgetter("folds_ns")):
            yield at_ns, list(together)
        done += len(entries)
        if progress is not None:
            progress(done, len(times))


def _slice(log: DoorLog, first_ns: int, before_ns: int) -> Iterator[HistoryEntry]:
    finder = log.said_finder()
    window = Window(happened_from_ns=first_ns, happened_before_ns=before_ns)
    hidden = log.retractions()
    batches = log.batches_in(window, on_page=finder.look_at)
    seen = (hidden.visible(batch) for batch in batches)
    return history((b for b in seen if len(b)), finder.said_of, Retractions())
