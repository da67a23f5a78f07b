"""Where a writer's keyframes come from, and their bytes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import KEYFRAME_CHANNEL
from semmap_log.store.chunks import BuiltChunk, build_chunk
from semmap_log.store.folder import LogFolder
from semmap_log.store.reading.reader import LogReader

Flush = Callable[[], None]
"""Hands the kernel what a writer holds back, before its log is read."""


@dataclass(frozen=True, slots=True)
class KeyframeMessage:
    """A state as it is stored."""

    event: int
    """The last event in it; -1: none."""
    data: bytes
    """The CDR bytes of its Keyframe message."""


class KeyframeSource(Protocol):
    """Knows the state after what was written, and when it should be stored."""

    def add(self, chunk: BuiltChunk) -> None:
        """Take in a chunk that was written; of a commit's several one after the other."""

    def wants_keyframe(self, *, is_commit_begun: bool) -> bool:
        """Return whether a keyframe should stand before what is written next.

        Args:
            is_commit_begun: A part of a commit was written; the log cannot be read up to here.
        """

    def keyframe(self) -> KeyframeMessage:
        """Return the state after what was written; it is stored now."""


K_co = TypeVar("K_co", bound=KeyframeSource, covariant=True)


class NewKeyframeSource(Protocol[K_co]):
    """Makes the source of a writer that is about to begin."""

    def __call__(self, folder: LogFolder, flush: Flush, reader: LogReader | None = None) -> K_co:
        """Return a source whose state is that of the log.

        Args:
            folder: The log's.
            flush: To be called before the log is read.
            reader: The log as it is; None: there is no event in it.

        Raises:
            LogError: The state cannot be known.
        """


def keyframe_chunk(keyframe: KeyframeMessage, log_time_ns: int) -> BuiltChunk:
    """Return the chunk that holds a keyframe.

    Args:
        keyframe: What it holds.
        log_time_ns: Of the record before it, or later.
    """
    record = mcap.message(KEYFRAME_CHANNEL, keyframe.event, log_time_ns, log_time_ns, keyframe.data)
    return build_chunk(record, np.zeros(1, np.int64))
