"""What a plan of JSON lines asks of a log, answered by one that holds no commits."""

from __future__ import annotations

from collections.abc import Iterator

from semmap_log.core.model.commits import Commit, Note
from semmap_log.core.model.events import Event
from semmap_log.interop.importing.line_commits import LineOptions

FILE_ID = bytes(range(16))


class NothingStored:
    """Knows no command."""

    def find(self, command_id: bytes) -> Commit | None:
        return None

    def events_of(self, commit: Commit) -> Iterator[Event]:
        raise AssertionError(commit)

    def comings(self, first: int, last: int) -> Iterator[Event]:
        return iter(())


def lines_of(tz: str, note: Note = Note(source="in.jsonl")) -> LineOptions:
    """Return how lines are taken, where only the zone matters."""
    return LineOptions(tz=tz, file_id=FILE_ID, note=note, log_tz=tz)
