"""What became of an append."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from typing import Any

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.commits import Commit
from semmap_log.core.model.events import Event
from semmap_log.core.model.shown_as_table import ShownAsTable


@dataclass(frozen=True, slots=True, repr=False)
class Appended(ShownAsTable):
    """What became of an append."""

    commit: Commit
    poses: int = 0
    """How many robot poses, which had waited, stand before its own events in the commit."""
    repeated: bool = False
    """The command was stored before; nothing was written now."""
    events: Sequence[Event | EventBatch] = field(default=(), repr=False, compare=False)
    """Its own events; empty where they were given as they came, one after the other."""
    _make_durable: Callable[[int], None] | None = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        first, again = self.first_event, ", stored before" if self.repeated else ""
        return f"<Appended events {first} to {first + self.count - 1}{again}>"

    @property
    def first_event(self) -> int:
        """Number of its own first event."""
        return self.commit.first_event + self.poses

    @property
    def count(self) -> int:
        """How many events of its own it has."""
        return self.commit.count - self.poses

    def wait(self) -> None:
        """Return once it survives a power cut, whatever the log's durability; threads share syncs.

        Raises:
            LogPoisonedError: The sync failed; the outcome is unknown until the log is reopened.
        """
        if self._make_durable is not None:
            self._make_durable(self.commit.last_event + 1)

    def __await__(self) -> Generator[Any, None, Appended]:
        """Wait without blocking the event loop: `appended = await log.append(events)`."""
        import asyncio

        yield from asyncio.to_thread(self.wait).__await__()
        return self
