"""Events of kinds that a later version of this program has added: how many, and what they touch.

What they mean is not known. Those whose kind is marked as changing nothing are left out of every
answer but a list of events; behind the first of another kind, every answer may be another one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import PurePath

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.events import KINDS
from semmap_log.errors import NewerLogError, NewerLogWarning
from semmap_log.store.event_fields import kinds_of
from semmap_log.store.form import FORMAT_VERSION
from semmap_log.store.kind_bits import UNKNOWN_BIT
from semmap_log.store.newer import is_later_kind, name_of
from semmap_log.store.reading.page_reading import read_page
from semmap_log.store.reading.segment_scan import Segment


@dataclass(frozen=True, slots=True)
class NewerEvents:
    """What of a log is unknown here."""

    counts: dict[str, int]
    """Kind -> how many events."""
    first: int | None = None
    """Number of the first event that may have changed more than itself."""
    first_kind: str = ""
    """What it is called."""
    minor: int = 0
    """The greatest minor version that has written to the log."""

    @classmethod
    def of(cls, segments: Sequence[Segment]) -> NewerEvents:
        """Look for them in all segments of a log; those without any are not read.

        Raises:
            CorruptLogError: A summary is damaged, or a chunk that holds some.
        """
        counts: Counter[str] = Counter()
        first: tuple[int | None, str] = None, ""
        for segment in segments:
            if segment.has_unknown_events:
                counts.update(_counts(segment))
                if first[0] is None:
                    first = _first(segment)
        return cls(dict(counts), *first, max(segment.header.minor for segment in segments))

    def reach(self, limit: int | None) -> bool:
        """Tell whether they may touch what is known by an event; None: by the log's end."""
        return self.first is not None and (limit is None or self.first <= limit)

    def refusal(self, log: PurePath) -> NewerLogError:
        """Return the error of whoever would need to know what they mean."""
        before = f"; what was known before it: --event {self.first - 1}" if self.first else ""
        return NewerLogError(
            f"{log}: written by a newer version of semmap-log (format {FORMAT_VERSION}."
            f"{self.minor}): event {self.first} is of kind {self.first_kind}, unknown here, and "
            "may have changed what is asked. Nothing is damaged: install the newer version. "
            f"Still answered: history, tail, show, info, verify{before}."
        )

    def warning(self, log: PurePath) -> NewerLogWarning:
        """Return what is said where they are left out."""
        return NewerLogWarning(
            f"{log}: left out, since a newer version of semmap-log has written them: "
            f"{self.in_words()}; by its own mark they change nothing else."
        )

    def in_words(self) -> str:
        """Return how many there are of each kind."""
        return ", ".join(f"{count} {kind}" for kind, count in self.counts.items())


def without_newer(batch: EventBatch) -> EventBatch:
    """Return the events of a batch whose kinds are known."""
    if not unknown_kinds(batch):
        return batch
    return batch.select(batch.kind <= len(KINDS))


def unknown_kinds(batch: EventBatch) -> set[int]:
    """Return the numbers of the unknown kinds in a batch."""
    return set(filter(is_later_kind, batch.objects))


def _counts(segment: Segment) -> Counter[str]:
    """Return how many events of each unknown kind are in a segment."""
    counts = segment.counts
    if counts is None:
        counts = Counter[int]()
        for kinds, _ in _kinds_and_numbers(segment):
            counts.update(kinds)
    names = segment.newer.names
    return Counter({name_of(c, names): n for c, n in counts.items() if is_later_kind(c) and n})


def _first(segment: Segment) -> tuple[int | None, str]:
    """Return number and name of a segment's first event that is not marked as harmless."""
    newer = segment.newer
    if newer.channels and {c for c, _ in newer.channels} <= newer.harmless:
        return None, ""
    for kinds, numbers in _kinds_and_numbers(segment):
        for kind, number in zip(kinds, numbers, strict=True):
            if kind not in newer.harmless:
                return number, name_of(kind, newer.names)
    return None, ""


def _kinds_and_numbers(segment: Segment) -> Iterator[tuple[list[int], list[int]]]:
    """Yield kinds and numbers of a segment's unknown events, chunk by chunk."""
    for place in segment.chunks.having(UNKNOWN_BIT).tolist():
        page = read_page(segment.chunks[place : place + 1], segment.header.first_event)
        kinds = kinds_of(page.heads["channel_id"])
        kinds = kinds[kinds > 0]
        is_unknown = np.array([is_later_kind(kind) for kind in range(2**8)])[kinds]
        yield kinds[is_unknown].tolist(), page.event_numbers()[is_unknown].tolist()
