"""Scans in, proposed doors out: the entry point of this package.

It also finds at which end a proposed door's leaf hangs, if a leaf was seen standing open.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, pi, radians, remainder, sin

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.door_watcher import DoorWatcher
from semmap_log.analysis.scans.proposing.jambs import at_jambs
from semmap_log.analysis.scans.proposing.swept_cells import SweptCells
from semmap_log.analysis.scans.proposing.wall_directions import along_their_walls
from semmap_log.analysis.scans.proposing.wall_gaps import Gaps, gaps_in
from semmap_log.analysis.scans.visit import DoorPlaces, PlacedScan, Visit
from semmap_log.core.model.doors import DoorState

Floats = NDArray[np.float64]

FREE = 0.6
"""The least share of a gap's line that must be free."""
OPENS_AT_M = (0.35, 0.5, 0.65)
"""Distances from the line, on both sides, at which the space should be wider than the gap ..."""
OPENS_BY_M = 0.22
"""... by so much beyond its ends."""
LEAST_SCORE = 0.5
LEAST_M, USUAL_M, MOST_M = 0.65, 1.4, 2.6
"""From jamb to jamb: a narrower gap is no door, wider ones than usual are rarer."""
KNOWN_M = 0.7
"""A gap whose middle is so near to that of a door of the map is that door."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """A door that may be there, and why."""

    level: int
    x: float
    y: float
    theta: float
    width: float
    """x, y of the line's start and width m, theta rad: as of a door; frame `map`. It starts at the
    hinge, where that was seen."""
    kind: str
    """As the annotation: `hinged`, a leaf was seen at the line's start; empty: unknown."""
    score: float
    """0..1: the evidence for a door; not a probability."""
    walls: float
    """Share of the line next to the gap that is wall, 0.6 m on both sides."""
    along: float
    """The same, 3 m on both sides."""
    free: float
    """Share of the gap that beams went through."""
    opens: float
    """Share of the places next to the gap, on both sides, that are free: at a corridor's mouth few
    are."""
    scans: int
    """That saw it."""
    visits: int
    """Which the scans are of."""
    seen_open: int
    """Visits that decided so."""
    seen_closed: int
    seen_ajar: int
    """Visits that took a leaf between shut and open for likely."""
    passed: int
    """How often the robot drove through."""

    @property
    def middle(self) -> tuple[float, float]:
        """Of the line, m."""
        half = self.width / 2
        return self.x + half * cos(self.theta), self.y + half * sin(self.theta)


def proposals_of(
    scans: Sequence[PlacedScan], doors: DoorPlaces, walls: Floats | None = None
) -> list[Proposal]:
    """Return doors that scans of one level show and the log lacks, best first.

    Args:
        scans: Of that level.
        doors: That are known.
        walls: (n, 2) m: the middles of a floor plan's wall cells; None: there is no floor plan, and
            what beams end on, time and again, is wall.

    Raises:
        FormatError: The scans lie too far apart for one map.
    """
    if not scans:
        return []
    level = scans[0].level
    swept = SweptCells.of(scans)
    gaps = gaps_in(swept.centres(swept.walls) if walls is None else walls)
    gaps = gaps.of(~_are_known(gaps, doors, level))
    if walls is not None:
        gaps = along_their_walls(gaps, walls)
    free = _free_share(swept, gaps)
    seen_through = free >= FREE
    gaps, free = at_jambs(gaps.of(seen_through), swept), free[seen_through]
    is_wide = gaps.lines[:, 3] >= LEAST_M
    gaps, free = gaps.of(is_wide), free[is_wide]
    opens = _opens(swept, gaps)
    visits = _visits(scans, gaps, level)
    found = [
        _proposal(gaps, i, level, (float(free[i]), float(opens[i])), visits[i])
        for i in range(len(gaps))
    ]
    good = [each for each in found if each.score >= LEAST_SCORE]
    return _apart(sorted(good, key=lambda each: (-each.score, each.x, each.y)))


def _are_known(gaps: Gaps, doors: DoorPlaces, level: int) -> NDArray[np.bool_]:
    x, y, theta, width = doors.lines[doors.levels == level].T
    there = np.stack([x + width / 2 * np.cos(theta), y + width / 2 * np.sin(theta)], axis=1)
    apart = np.hypot(*(gaps.middles[:, None] - there[None]).transpose(2, 0, 1))
    near = np.maximum(KNOWN_M, width[None] / 2)
    is_known: NDArray[np.bool_] = (apart < near).any(1)
    return is_known


def _places(gaps: Gaps, along: Floats, off: Floats) -> tuple[Floats, Floats]:
    """Return places (n, ...) by how far along a gap's line, and how far left of it, they are."""
    x, y, theta, _ = (column[:, None] for column in gaps.lines.T)
    return (
        x + along * np.cos(theta) - off * np.sin(theta),
        y + along * np.sin(theta) + off * np.cos(theta),
    )


def _free_share(swept: SweptCells, gaps: Gaps) -> Floats:
    """Return (n,) the share of each gap that beams went through, 0.2 m to both sides, too."""
    seen_free = swept.passed > 1
    shares = np.linspace(0.1, 0.9, 9)
    rows = []
    for off in (-0.2, 0.0, 0.2):
        along = gaps.lines[:, 3:] * shares
        rows.append(swept.at(seen_free, *_places(gaps, along, np.full_like(along, off))).mean(1))
    shares_free: Floats = np.min(rows, axis=0)
    return shares_free


def _opens(swept: SweptCells, gaps: Gaps) -> Floats:
    """Return (n,) how much wider than the gap the space is, on both sides.

    On each side the better of both ends counts: an open leaf stands at one, a corner can be there.
    """
    seen_free = swept.passed > 1
    sides = []
    for sign in (-1.0, 1.0):
        off = sign * np.array(OPENS_AT_M)[None].repeat(len(gaps), 0)
        ends = [np.full_like(off, -OPENS_BY_M), gaps.lines[:, 3:] + OPENS_BY_M + 0 * off]
        each = [swept.at(seen_free, *_places(gaps, along, off)).mean(1) for along in ends]
        sides.append(np.maximum(*each))
    opens: Floats = np.mean(sides, axis=0)
    return opens


def _visits(scans: Sequence[PlacedScan], gaps: Gaps, level: int) -> dict[int, list[Visit]]:
    """Return the visits to each gap, by its row: it is looked at as if it were a door."""
    ids = np.arange(1, len(gaps) + 1)
    places = DoorPlaces(
        ids, np.full(len(gaps), level), gaps.lines, ("",) * len(gaps), np.zeros(len(gaps), bool)
    )
    watcher = DoorWatcher()
    found: dict[int, list[Visit]] = defaultdict(list)
    for visit in [*watcher.take(scans, places), *watcher.close()]:
        found[visit.door_id - 1].append(visit)
    return found


def _proposal(
    gaps: Gaps, row: int, level: int, shares: tuple[float, float], visits: Sequence[Visit]
) -> Proposal:
    looked = [visit for visit in visits if not visit.passed]
    hinge = hinge_of(gaps.lines[row], looked)
    x, y, theta, width = _from_hinge(gaps.lines[row], hinge).tolist()
    free, opens = shares
    walls, along = float(gaps.walls[row].mean()), float(gaps.along[row])
    passed = len(visits) - len(looked)
    seen_open = sum(v.state is DoorState.OPEN for v in looked)
    ajar = sum(v.ajar > 0.5 and v.through + v.stopped > 0.7 for v in looked)
    return Proposal(
        level=level, x=x, y=y, theta=theta, width=width,
        kind="hinged" if hinge else "",
        score=_score(along, opens, width, passed=passed, seen_open=seen_open),
        walls=walls, along=along, free=free, opens=opens,
        scans=sum(v.scans for v in looked), visits=len(looked), seen_open=seen_open,
        seen_closed=sum(v.state is DoorState.CLOSED for v in looked),
        seen_ajar=ajar, passed=passed,
    )  # fmt: skip


def _from_hinge(line: Floats, hinge: str) -> Floats:
    """Return a line that starts at its hinge."""
    if hinge != "end":
        return line
    x, y, theta, width = line.tolist()
    return np.array([x + width * cos(theta), y + width * sin(theta), theta + pi, width])


def _score(along: float, opens: float, width: float, *, passed: int, seen_open: int) -> float:
    """Return the evidence for a door, 0..1, by its wall, the space beyond it, its width and use."""
    use = 1.0 if passed else (0.8 if seen_open else 0.3)
    wide = float(np.clip((MOST_M - width) / (MOST_M - USUAL_M), 0.4, 1.0))
    return along * opens * wide * use


def _apart(proposals: Sequence[Proposal]) -> list[Proposal]:
    """Return those that are not within another's reach: of two the better one."""
    kept: list[Proposal] = []
    for each in proposals:
        if all(_distance(each, other) >= KNOWN_M for other in kept):
            kept.append(each)
    return kept


def _distance(one: Proposal, other: Proposal) -> float:
    (x, y), (other_x, other_y) = one.middle, other.middle
    return hypot(x - other_x, y - other_y)


TURNED = radians(24)
"""A leaf that is turned less against the line may be a recess, or slide."""
LOOKS = 4.0
"""A visit that is worth fewer does not show a leaf."""
LEAST_VISITS = 2
"""That saw it."""
AGREED = 0.75
"""So large a share of the visits that saw a leaf has to see it at the same end."""
WIDEST_M = 1.4
"""In a wider opening a single leaf cannot be distinguished from one of two."""


def hinge_of(line: NDArray[np.float64], visits: Sequence[Visit]) -> str:
    """Return `start` or `end`: where a single leaf hangs; empty: nobody saw.

    Args:
        line: x, y of the start m, theta rad, width m.
        visits: To it.
    """
    if line[3] > WIDEST_M:
        return ""
    at = [end for visit in visits if (end := _seen_at(line, visit))]
    for end in ("start", "end"):
        if len(at) >= LEAST_VISITS and at.count(end) >= AGREED * len(at):
            return end
    return ""


def _seen_at(line: NDArray[np.float64], visit: Visit) -> str:
    """Return at which end a visit saw a leaf hang; empty: it did not."""
    if visit.passed or visit.looks < LOOKS or len(visit.leaves) != 1:
        return ""
    x, y, theta, width = line.tolist()
    ((from_x, from_y, to_x, to_y),) = visit.leaves
    turned = abs(remainder(atan2(to_y - from_y, to_x - from_x) - theta, pi))
    if turned < TURNED:
        return ""
    return "start" if hypot(from_x - x, from_y - y) < width / 2 else "end"
