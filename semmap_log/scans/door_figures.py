"""What all visits to a door tell together."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import isfinite, nan

from semmap_log.domain.doors import DoorId, DoorState
from semmap_log.scans.visit import Visit


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorFigures:
    """The figures of a door, over its visits."""

    door_id: DoorId
    visits: int
    open: int
    """Visits that say OPEN."""
    closed: int
    undecided: int
    passed: int
    """Visits in which the robot drove through."""
    accuracy: float
    """Mean of those that are decided; NaN: none is."""
    opening: float
    """Mean of all that saw anything of it, 0..1; NaN: none did."""
    behind_m: float
    """Mean place of beams that ended near the line: behind (+) it, or before (-), as the robot sees
    it; NaN: none did."""
    left_m: float
    """The same to the left (+) or right (-) of the line; NaN: no visit tells from which side."""
    why: str
    """The commonest reason of those that are undecided; empty: there are none."""

    @property
    def decided(self) -> int:
        """Visits that say OPEN or CLOSED."""
        return self.open + self.closed


def door_figures(visits: Iterable[Visit]) -> list[DoorFigures]:
    """Return the figures of each door that was visited, ids ascending."""
    return [_figures(door_id, those) for door_id, those in visits_by_door(visits)]


def visits_by_door(visits: Iterable[Visit]) -> list[tuple[DoorId, list[Visit]]]:
    """Return the visits of each door, ids ascending; those of a door keep their order."""
    found: defaultdict[DoorId, list[Visit]] = defaultdict(list)
    for visit in visits:
        found[visit.door_id].append(visit)
    return sorted(found.items())


def _figures(door_id: DoorId, visits: Sequence[Visit]) -> DoorFigures:
    states = Counter(visit.state for visit in visits)
    reasons = Counter(visit.why for visit in visits if is_undecided(visit) and visit.why)
    return DoorFigures(
        door_id=door_id,
        visits=len(visits),
        open=states[DoorState.OPEN],
        closed=states[DoorState.CLOSED],
        undecided=sum(map(is_undecided, visits)),
        passed=sum(visit.passed for visit in visits),
        accuracy=_mean(visits, lambda v: nan if is_undecided(v) else v.accuracy),
        opening=_mean(visits, lambda v: v.opening),
        behind_m=_mean(visits, lambda v: v.behind_m),
        left_m=_mean(visits, left_of),
        why=max(reasons, key=lambda why: (reasons[why], why), default=""),
    )


def is_undecided(visit: Visit) -> bool:
    """Tell whether a visit says neither OPEN nor CLOSED."""
    return visit.state not in (DoorState.OPEN, DoorState.CLOSED)


def left_of(visit: Visit) -> float:
    """Return how far to the left of the line beams ended that ended near it, m; NaN: not told."""
    return -visit.side * visit.behind_m if visit.side else nan


def _mean(visits: Sequence[Visit], value: Callable[[Visit], float]) -> float:
    told = [each for each in map(value, visits) if isfinite(each)]
    return sum(told) / len(told) if told else nan
