"""How a verification has keyframes checked: by what knows the state that they hold."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import PurePath
from typing import Protocol

from semmap_log.store.verification.hash_chain import Report
from semmap_log.store.verification.pieces import Piece


@dataclass(frozen=True, slots=True)
class KeyframePlace:
    """A chunk: the number of its segment's file in the walk, and its offset there."""

    file: int
    offset: int


Reread = Callable[[KeyframePlace], Iterator[Piece]]
"""Yields the chunks of the log from a place on."""


class KeyframeCheck(Protocol):
    """Takes all chunks of a log, and compares each keyframe with what the events say."""

    @property
    def compared(self) -> int:
        """How many keyframes were compared, and right."""

    def begin(self) -> None:
        """Begin at the log's first event, where the state is empty."""

    def forget(self) -> None:
        """Events are missing: no state is known until the next keyframe."""

    def give_up(self) -> None:
        """Compare no more: events that nobody here understands may have changed the state."""

    def add(self, path: PurePath, piece: Piece, place: KeyframePlace, next_event: int) -> None:
        """Take the next chunk, of which `next_event` is the first event, or comes before it."""

    def finish(self) -> None:
        """Read the events that wait: their payloads must be what their channels carry."""


NewKeyframeCheck = Callable[[Report, Reread], KeyframeCheck]
"""Makes the check of one reading: what is wrong is reported, and chunks are had once more."""
