"""Commands: what a log is asked to append, as values.

A command tells who asks and why, and makes its events of the map as it stands when its turn has
come: one that is sent again may speak of a door that it has removed itself.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from semmap_log.core.batches.event_batch import EventBatch, one_by_one
from semmap_log.core.model.commits import NO_CONTENT, Commit, Note
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import Event
from semmap_log.log.door_log.command_content import are_same
from semmap_log.log.door_log.current_map import CurrentMap
from semmap_log.log.door_log.times import Time
from semmap_log.store.gone_commands import StoredCommand

Events: TypeAlias = "Iterable[Event | EventBatch] | EventBatch"
"""What can be appended: events, and batches of them, in any order."""


class CommandContext(NamedTuple):
    """When, who and why: what a command tells besides what it asks for."""

    at: Time = None
    """When it happened; None: when it is recorded."""
    note: Note = Note()
    """Who, with what, why."""
    command_id: bytes | None = None
    """16 bytes: the same command, sent again, is stored once."""
    expected_event: int | None = None
    """Number of the last event, as the caller knows it; -1: none; None: nothing is expected."""


@dataclass(frozen=True, slots=True)
class Command(ABC):
    """What is to be appended as one commit, all or none."""

    context: CommandContext

    @property
    @abstractmethod
    def content(self) -> bytes:
        """Digest of what it asks for, 16 bytes, by which it is known when it is sent again."""

    @abstractmethod
    def events(self, now: CurrentMap) -> Iterable[Event | EventBatch]:
        """Return its events, as the map stands.

        Raises:
            CommandError: The map forbids it.
        """

    def is_stored_as(self, commit: Commit, events: Sequence[Event]) -> bool:
        """Tell whether a commit of its id is what it became.

        Args:
            commit: The commit.
            events: All of its events.
        """
        del events
        return commit.content == self.content

    def is_sealed_as(self, stored: StoredCommand) -> bool:
        """Tell whether a command of its id, of which something was taken out, is this one."""
        return stored.has_content(self.content)

    @property
    def own_count(self) -> int | None:
        """How many events it has; None: none of them is a pose, so that it shows."""
        return None

    def door_expected(self, events: Iterable[Event | EventBatch]) -> DoorId | None:
        """Return of which door `expected_event` tells the last event; None: of the log.

        Args:
            events: Its own, as the map stands.
        """
        del events
        return None


@dataclass(frozen=True, slots=True)
class GivenEvents(Command):
    """Events that somebody has made; those of a command of theirs are compared, or a digest is."""

    given: Iterable[Event | EventBatch]
    content: bytes = NO_CONTENT

    @classmethod
    def of(
        cls, events: Events, context: CommandContext, content: bytes = NO_CONTENT
    ) -> GivenEvents:
        """Return the command; its events are read at once only if they may have to be compared."""
        given = [events] if isinstance(events, EventBatch) else events
        if context.command_id is not None and content == NO_CONTENT and not isinstance(given, list):
            given = list(given)
        return cls(context, given, content)

    def events(self, now: CurrentMap) -> Iterable[Event | EventBatch]:
        """Return what was given."""
        del now
        return self.given

    @property
    def own_count(self) -> int | None:
        """How many there are; None: they come one after the other."""
        if not isinstance(self.given, Sequence) or not self.given:
            return None
        return sum(len(one) if isinstance(one, EventBatch) else 1 for one in self.given)

    def is_stored_as(self, commit: Commit, events: Sequence[Event]) -> bool:
        """Tell whether the digest is that of the commit; without one, the events and the note."""
        if self.content != NO_CONTENT:
            return commit.content == self.content
        wanted = list(one_by_one(self.given))
        return self.context.note == commit.note and are_same(wanted, events[-len(wanted) :])

    def is_sealed_as(self, stored: StoredCommand) -> bool:
        """Tell the same, by the digest, or by the events and the note."""
        if self.content != NO_CONTENT or stored.seal is None:
            return stored.has_content(self.content)
        command_id = stored.commit.command_id
        return stored.seal.fits(
            command_id, NO_CONTENT, self.context.note, list(one_by_one(self.given))
        )


@dataclass(frozen=True, slots=True)
class MadeEvents(Command):
    """Events that somebody makes when the command's turn has come; maybe none are wanted then."""

    make: Callable[[], Sequence[Event]]
    content: bytes

    def events(self, now: CurrentMap) -> Sequence[Event]:
        """Return what is made."""
        del now
        return self.make()


@dataclass(frozen=True, slots=True)
class TakenOver(Command):
    """A commit of another log."""

    make: Callable[[int], Iterable[Event | EventBatch]]
    """Gives its events; is told the number that the first of them gets."""
    content: bytes

    def events(self, now: CurrentMap) -> Iterable[Event | EventBatch]:
        """Return what is given."""
        return self.make(now.next_event)


WAITING_POSES = GivenEvents(CommandContext(), ())
"""No events of its own: what waits is written."""
