"""Which round of a patrol was the last."""

from __future__ import annotations

from semmap_log.core.model.events import PatrolFinished, PatrolStarted
from semmap_log.store.kind_bits import bits_of_kinds
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window


def last_patrol(reader: LogReader, kind: type[PatrolStarted | PatrolFinished]) -> int:
    """Return the greatest number of a round that began, or ended; 0: none did."""
    hidden = reader.retractions()
    batches = map(hidden.visible, reader.batches(Window(kinds=bits_of_kinds([kind]))))
    return max((int(batch[kind]["patrol"].max()) for batch in batches if len(batch)), default=0)
