"""Visits to doors as pictures: their captions, their geometry, and which of them to draw.

Geometry lies in the frame of the door: its line runs along from 0 to its width; across is positive
to the left. It holds where beams ended, where the laser went, and how the leaf stands. Of many
visits, those that a person should look at are chosen.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.door_figures import is_undecided
from semmap_log.analysis.scans.visit import (
    DEFAULT,
    DoorLine,
    KeptVisit,
    PlacedScan,
    Visit,
    visit_key,
)
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.moments import format_short

ALMOST_SURE = 0.995


def verdict(visit: Visit) -> str:
    """Return a visit's verdict: `CLOSED .98`, `UNKNOWN: ajar`."""
    if visit.passed:
        return f"{visit.state.name}, driven through"
    if is_undecided(visit):
        return f"{visit.state.name}: {visit.why}" if visit.why else visit.state.name
    return f"{visit.state.name} {share(visit.accuracy)}"


def grounds(visit: Visit) -> str:
    """Return the verdict's grounds: `12 looks: 0.0 through, 5.2 on the line, +0.03 m`."""
    looks, through, stopped = map(_about, (visit.looks, visit.through, visit.stopped))
    said = f"{looks} looks: {through} through, {stopped} on the line"
    is_told = isfinite(visit.behind_m) and visit.state is not DoorState.OPEN
    return f"{said}, {visit.behind_m:+.2f} m" if is_told else said


def when(visit: Visit, tz: str) -> str:
    """Return when it ended, on the clocks of a zone."""
    return format_short(visit.last_ns, tz)


def share(value: float) -> str:
    """Return a share of 1 with two digits, none before the point: `.98`; with more from `.995` on.

    A value below 1 is never shown as 1.
    """
    digits = 2 if value < ALMOST_SURE else 3
    while value < 1 and float(f"{value:.{digits}f}") >= 1:
        digits += 1
    text = f"{value:.{digits}f}"
    return text[1:] if text.startswith("0.") else text


def _about(number: float) -> str:
    return f"{number:.1f}" if number < 10 else f"{number:.0f}"


Points = NDArray[np.float64]
"""(n, 2) m"""


class Fate(IntEnum):
    """What became of a beam that was sent toward the door's line."""

    aside = 0
    """Not toward the line: it passes the ends, or would have met it too flat."""
    short = 1
    """It ended before the line: somebody stood there."""
    stopped = 2
    """It ended on it."""
    through = 3
    """It ended behind it."""
    lost = 4
    """It did not come back."""


@dataclass(frozen=True, slots=True, eq=False)
class SeenBeams:
    """Beams of some scans, `n` in all, without those that were not measured."""

    begins: Points
    ends: Points
    """Of one that is lost: where it meets the line; NaN if it does not."""
    fates: NDArray[np.uint8]
    """(n,) `Fate`."""

    def of(self, fate: Fate) -> SeenBeams:
        """Return the beams of that fate."""
        chosen = self.fates == fate
        return SeenBeams(self.begins[chosen], self.ends[chosen], self.fates[chosen])

    def toward(self) -> SeenBeams:
        """Return those that were sent toward the line."""
        chosen = self.fates != Fate.aside
        return SeenBeams(self.begins[chosen], self.ends[chosen], self.fates[chosen])


@dataclass(frozen=True, slots=True, eq=False)
class DoorScene:
    """The content of a visit's picture, in the door's frame."""

    width: float
    beams: SeenBeams
    track: Points
    """Where the laser was at each scan."""
    leaves: Points
    """(2 k, 2): each leaf's two ends."""


def door_scene(kept: KeptVisit) -> DoorScene:
    """Return the content to draw for a visit."""
    places = [scan.origins[len(scan.origins) // 2] for scan in kept.scans]
    leaves = np.array(kept.visit.leaves, np.float64).reshape(-1, 2)
    return DoorScene(
        kept.line[3],
        seen_beams(kept.scans, kept.line),
        in_door_frame(np.array(places, np.float64).reshape(-1, 2), kept.line),
        in_door_frame(leaves, kept.line),
    )


def seen_beams(scans: Sequence[PlacedScan], line: DoorLine) -> SeenBeams:
    """Return the beams of scans as the door's line sees them, in its frame."""
    each = [_beams(scan, line) for scan in scans] or [_beams_of_none()]
    return SeenBeams(
        np.concatenate([beams.begins for beams in each]),
        np.concatenate([beams.ends for beams in each]),
        np.concatenate([beams.fates for beams in each]),
    )


def _beams(scan: PlacedScan, line: DoorLine) -> SeenBeams:
    known = ~np.isnan(scan.ranges)
    begins, ranges = in_door_frame(scan.origins[known], line), scan.ranges[known]
    turned = scan.bearings[known] - line[2]
    way = np.column_stack([np.cos(turned), np.sin(turned)])
    with np.errstate(divide="ignore", invalid="ignore"):
        plane = -begins[:, 1] / way[:, 1]
        along = begins[:, 0] + plane * way[:, 0]
    toward = (plane > 0) & (along > 0) & (along < line[3])
    toward &= np.abs(way[:, 1]) > np.sin(DEFAULT.flattest)
    lost = ranges >= scan.max_range
    ends = begins + np.where(lost, np.where(toward, plane, np.nan), ranges)[:, None] * way
    return SeenBeams(begins, ends, _fates(ranges, plane, toward, lost))


def _fates(
    ranges: NDArray[np.float64],
    plane: NDArray[np.float64],
    toward: NDArray[np.bool_],
    lost: NDArray[np.bool_],
) -> NDArray[np.uint8]:
    near = DEFAULT.tolerance
    behind = ranges - plane
    fates = np.select(
        [~toward, lost, behind > near, behind >= -near],
        [Fate.aside, Fate.lost, Fate.through, Fate.stopped],
        Fate.short,
    )
    return fates.astype(np.uint8)


def _beams_of_none() -> SeenBeams:
    return SeenBeams(np.empty((0, 2)), np.empty((0, 2)), np.empty(0, np.uint8))


def in_door_frame(points: Points, line: DoorLine) -> Points:
    """Return points of the map in the frame of a door."""
    x, y, theta, _ = line
    cos, sin = np.cos(theta), np.sin(theta)
    offsets = points - [x, y]
    return np.column_stack([
        cos * offsets[:, 0] + sin * offsets[:, 1], cos * offsets[:, 1] - sin * offsets[:, 0]
    ])  # fmt: skip


def on_the_map(points: Points, line: DoorLine) -> Points:
    """Return points of a door's frame on the map."""
    x, y, theta, _ = line
    cos, sin = np.cos(theta), np.sin(theta)
    return np.column_stack([
        x + cos * points[:, 0] - sin * points[:, 1], y + sin * points[:, 0] + cos * points[:, 1]
    ])  # fmt: skip


ReadVisits = Callable[[Callable[[Visit], bool] | None], Iterable[KeptVisit]]
"""Yields visits, with scans where they are wanted."""


def drawn_visits(read: ReadVisits, most: int) -> dict[DoorId, list[KeptVisit]]:
    """Return the visits of each door that are most worth a look, with their scans."""
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
    """Return the indices of the visits to show, at most so many, in their order.

    Half are the least certain ones; the others are spread evenly over the rest, so that usual ones
    are included. Passages are left out, since they have no scan to look at.
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
