"""A chunk that is being filled with runs of records, and its template: all but their values."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.store.byte_layout import COMMIT_CHANNEL
from semmap_log.store.chunks import NO_SPAN, BuiltChunk, assemble_chunk, message_indexes
from semmap_log.store.record_runs import FEW, MOST, AnyRun, MixedRun, Span


class ChunkBuilder:
    """Message records for a chunk, whose log times are one nanosecond apart."""

    __slots__ = ("_records", "_runs", "size", "span", "start_ns", "time")

    def __init__(self, start_ns: int) -> None:
        """Begin.

        Args:
            start_ns: Log time of the first record.
        """
        self.start_ns = start_ns
        self.time = start_ns
        """Log time of the next record."""
        self.size = 0
        self.span: Span = NO_SPAN
        """Least and greatest happened time of its events."""
        self._runs: list[AnyRun] = []
        self._records: list[bytes] = []
        """Of each run."""

    def add(self, run: AnyRun, records: bytes, span: Span = NO_SPAN) -> None:
        """Add a run, whose first record has the time that is next.

        Args:
            run: What its records are.
            records: They themselves.
            span: Least and greatest happened time of its events.
        """
        self._runs.append(run)
        self._records.append(records)
        self.size += len(records)
        self.time += run.count
        if self.span is NO_SPAN:
            self.span = span
        elif span is not NO_SPAN:
            self.span = min(self.span[0], span[0]), max(self.span[1], span[1])

    def hash_into(self, digests: dict[int, Any]) -> None:
        """Take its records into the digests of their channels."""
        for run, records in zip(self._runs, self._records, strict=True):
            if isinstance(run, MixedRun):
                for channel, its in run.of_channel.items():
                    _hash(digests, channel, its)
            else:
                _hash(digests, run.channel, records)

    def chunk(self) -> BuiltChunk:
        """Return the chunk."""
        runs = tuple(self._runs)
        template = ChunkTemplate(runs) if _is_rare(runs) else kept_template(runs)
        return template.chunk(b"".join(self._records), self.start_ns, self.span)


class ChunkTemplate:
    """A chunk of runs: all that does not depend on its records' values."""

    def __init__(self, runs: Sequence[AnyRun]) -> None:
        """Prepare it."""
        self._channels = np.concatenate([_channels_of(run) for run in runs])
        sizes = np.concatenate([_sizes_of(run) for run in runs])
        self._offsets = np.cumsum(sizes) - sizes
        self._steps = np.arange(len(sizes), dtype=np.int64)
        is_closed = self._channels[-1] == COMMIT_CHANNEL
        self._commit_at = int(self._offsets[-1]) if is_closed else -1

    def index(self, start_ns: int) -> tuple[bytes, dict[int, int]]:
        """Return its MessageIndex records, and channel id -> messages.

        Args:
            start_ns: Log time of the first record.
        """
        return message_indexes(self._channels, self._steps + start_ns, self._offsets)

    def chunk(self, records: bytes, start_ns: int, span: Span) -> BuiltChunk:
        """Return the chunk of these records.

        Args:
            records: Of all runs.
            start_ns: Log time of the first.
            span: Least and greatest happened time of its events.
        """
        count = len(self._steps)
        index, counts = self.index(start_ns)
        times = (start_ns, start_ns + count - 1)
        built = assemble_chunk(records, index, counts, times=times, happened=span)
        built.commit_at = self._commit_at
        if count > FEW:
            built.offsets = self._offsets
        return built


class _KeptTemplate(ChunkTemplate):
    """A template that is used again and again.

    Its index is one number, to which each nanosecond that the chunk begins later adds the same.
    """

    def __init__(self, runs: Sequence[AnyRun]) -> None:
        super().__init__(runs)
        at_0, self._counts = super().index(0)
        at_1, _ = super().index(1)
        self._size = len(at_0)
        self._at_0 = int.from_bytes(at_0, "little")
        self._per_ns = int.from_bytes(at_1, "little") - self._at_0

    def index(self, start_ns: int) -> tuple[bytes, dict[int, int]]:
        index = self._at_0 + start_ns * self._per_ns
        return index.to_bytes(self._size, "little"), self._counts


kept_template = lru_cache(maxsize=128)(_KeptTemplate)


def _is_rare(runs: Sequence[AnyRun]) -> bool:
    """Return whether such a chunk will hardly come again."""
    return len(runs) > FEW or any(run.count > MOST or isinstance(run, MixedRun) for run in runs)


def _channels_of(run: AnyRun) -> NDArray[np.uint16]:
    return run.channels if isinstance(run, MixedRun) else np.full(run.count, run.channel, np.uint16)


def _sizes_of(run: AnyRun) -> NDArray[np.int64]:
    return run.sizes if isinstance(run, MixedRun) else np.full(run.count, run.record_size, np.int64)


def _hash(digests: dict[int, Any], channel: int, records: bytes) -> None:
    known = digests.get(channel)
    if known is None:
        digests[channel] = hashlib.sha256(records)
    else:
        known.update(records)
