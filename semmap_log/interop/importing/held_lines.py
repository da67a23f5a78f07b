"""JSON lines whose sightings a log holds already, by another file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Protocol

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import DoorObserved, DoorUpdated
from semmap_log.interop.formats.json.event_json_reader import ParsedLine
from semmap_log.interop.importing.held_sightings import AT_ONCE, HeldSightings
from semmap_log.interop.importing.line_commits import LineOptions, part_id
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.store.gone_commands import StoredCommand

MOST_PARTS = 100
"""Of so many commits of a file it is looked whether an import that was interrupted wrote one."""
Line = tuple[int, ParsedLine]


class FindsCommands(Protocol):
    """Finds commands in a log."""

    def find(self, command_id: bytes) -> StoredCommand | None:
        """Return that command, if it is stored."""


class HeldLines:
    """Leaves out lines that no log wrote if what they say is in the log by another file."""

    def __init__(self, log: DoorLog, stored: FindsCommands, options: LineOptions) -> None:
        """Look whether the log has commits of the file itself: they are none of another."""
        ids = (options.file_id, *(part_id(options, place) for place in range(MOST_PARTS)))
        own = [found.commit.first_event for each in ids if (found := stored.find(each))]
        self._log = log
        self._before_event = min(own) if own else None
        self._source = options.source
        self._by_source: dict[str, HeldSightings] = {}
        self.lines: list[int] = []
        """Those that were left out, by their numbers."""

    def left(self, lines: Iterable[Line]) -> Iterator[Line]:
        """Yield the lines that are left, in their order."""
        every = iter(lines)
        while some := list(islice(every, AT_ONCE)):
            held = self._held(some)
            self.lines += sorted(held)
            yield from (line for line in some if line[0] not in held)

    def _held(self, lines: list[Line]) -> set[int]:
        """Return the numbers of the lines that the log holds."""
        by_source: dict[str, list[Line]] = {}
        for line in lines:
            parsed = line[1]
            is_own = parsed.command_id is None and parsed.number is None
            if is_own and isinstance(parsed.event, DoorObserved | DoorUpdated):
                by_source.setdefault(parsed.note.source or self._source, []).append(line)
        held: set[int] = set()
        for source, some in by_source.items():
            finder = self._by_source.get(source)
            if finder is None:
                finder = self._by_source[source] = HeldSightings(
                    self._log, source=source, before_event=self._before_event
                )
            found = finder.among(EventBatch.from_events(parsed.event for _, parsed in some))
            held.update(some[place][0] for place in np.flatnonzero(found).tolist())
        return held
