"""Which doors and visits are drawn of all that a report is about, with their scans."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator

from semmap_log.analysis.scans.kept_visit import KeptVisit, visit_key
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.doors import DoorId
from semmap_log.views.sightings.worth_a_look import worth_a_look

ReadVisits = Callable[[Callable[[Visit], bool] | None], Iterable[KeptVisit]]
"""Yields visits, with the scans of those that are wanted."""


def drawn_visits(read: ReadVisits, most: int) -> dict[DoorId, list[KeptVisit]]:
    """Return of each door at most so many visits that are worth a look, with their scans."""
    by_door: defaultdict[DoorId, list[Visit]] = defaultdict(list)
    for kept in read(None):
        by_door[kept.visit.door_id].append(kept.visit)
    chosen = {
        visit_key(visits[place])
        for visits in by_door.values()
        for place in worth_a_look(visits, most)
    }  # fmt: skip
    found: dict[DoorId, list[KeptVisit]] = {door_id: [] for door_id in sorted(by_door)}
    for kept in _wanted(read, chosen):
        found[kept.visit.door_id].append(kept)
    return found


def _wanted(read: ReadVisits, chosen: set[tuple[object, ...]]) -> Iterator[KeptVisit]:
    for kept in read(lambda visit: visit_key(visit) in chosen):
        if visit_key(kept.visit) in chosen:
            yield kept
