"""Which doors and visits are drawn of all that a report is about, with their scans.

Which of many visits a person should look at.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from semmap_log.analysis.scans.door_figures import is_undecided
from semmap_log.analysis.scans.visit import KeptVisit, Visit, visit_key
from semmap_log.core.model.doors import DoorId

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


def worth_a_look(visits: Sequence[Visit], most: int) -> list[int]:
    """Return the places of at most so many visits, in their order.

    Half are those that are least sure; the others are spread evenly over the rest, so that what
    is usual is there, too. Where the robot drove through there is no scan to look at.
    """
    seen = [place for place, visit in enumerate(visits) if not visit.passed]
    if len(seen) <= most:
        return seen
    doubtful = sorted(seen, key=lambda place: _sureness(visits[place]))[: most // 2]
    rest = [place for place in seen if place not in set(doubtful)]
    even = np.linspace(0, len(rest) - 1, most - len(doubtful)).round().astype(int)
    return sorted([*doubtful, *(rest[place] for place in even)])


def _sureness(visit: Visit) -> tuple[bool, float]:
    return (not is_undecided(visit), visit.accuracy)
