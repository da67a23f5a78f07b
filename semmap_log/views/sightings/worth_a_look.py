"""Which of many visits a person should look at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from semmap_log.analysis.scans.door_figures import is_undecided
from semmap_log.analysis.scans.visit import Visit


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
