"""Events as the columns that a log would give, without a log."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.messages import OBJECT_KINDS, decode, encode
from semmap_log.core.model.events import Event


def batch_of(
    events: Iterable[Event], *, first_number: int = 0, recorded_ns: Sequence[int] | None = None
) -> EventBatch:
    """Return events as columns, numbered from `first_number` on.

    Args:
        events: Events; where `happened_ns` is None, the recorded time stands in.
        first_number: Number of the first.
        recorded_ns: Recorded time of each; default: 0, 1, 2 …
    """
    listed = list(events)
    recorded = list(range(len(listed))) if recorded_ns is None else list(recorded_ns)
    stored = [_as_stored(event, ns) for event, ns in zip(listed, recorded, strict=True)]
    batch = EventBatch.from_events(stored)
    numbers = np.arange(first_number, first_number + len(listed), dtype=np.int64)
    return replace(batch, number=numbers, recorded_ns=np.array(recorded, np.int64))


def _as_stored(event: Event, recorded_ns: int) -> Event:
    """Return an event as a log gives it back."""
    happened_ns = recorded_ns if event.happened_ns is None else event.happened_ns
    if event.kind not in OBJECT_KINDS:
        return replace(event, happened_ns=happened_ns)
    level = getattr(event, "level", 0)
    return decode(event.kind, encode(event, happened_ns), happened_ns, level)
