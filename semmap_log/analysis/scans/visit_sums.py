"""What a visit has seen so far, as sums."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.door_beams import Sights
from semmap_log.analysis.scans.leaves import LOG_WEIGHTS, SHIFTS, Leaves
from semmap_log.analysis.scans.sight_sums import SightSums
from semmap_log.analysis.scans.visit import ScanModel

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SeenBy:
    """The scan that a sight is of."""

    stamp_ns: int
    laser: str
    fresh: float
    """Of a new scan it is worth so much."""
    stand: int
    """Where the robot stood: see `Stands`."""


@dataclass(slots=True, eq=False)
class VisitSums:
    """The sums of a visit that is still going on; each beam weighed by what a look at it is worth.

    Shifts of the laser stay apart (s,): summed over them scan by scan, one constant error of 10 cm
    would look like many independent proofs.
    """

    first_ns: int
    last_ns: int
    table: Floats
    """(s, h): log-likelihoods of the shift and the stand of the leaves."""
    walls: Floats
    """(s + 1,): of the shift by the adjacent walls; the last: the wall is not in line."""
    through: Floats
    stopped: Floats
    deep: Floats
    """(s,) looks through the line, on it, far beyond it."""
    scans: int = 0
    looks: float = 0.0
    wall_looks: float = 0.0
    hidden: float = 0.0
    """Looks that ended well before the line."""
    near: float = 0.0
    behind: float = 0.0
    """Looks that ended near the line, and the sum of how far beyond it, m."""
    sides: set[int] = field(default_factory=set)
    """From which it was seen: 1 the left of the line, -1 the right."""
    stands: set[int] = field(default_factory=set)
    """Where the robot stood meanwhile: numbers, see `Stands`."""
    lasers: dict[str, float] = field(default_factory=dict)
    """How many of the looks each laser had."""

    @property
    def laser(self) -> str:
        """Which laser had most looks."""
        return max(sorted(self.lasers), key=lambda laser: self.lasers[laser])

    @classmethod
    def begun(cls, stamp_ns: int, leaves: Leaves) -> VisitSums:
        """Return a visit that has seen nothing."""
        s, h = len(SHIFTS), len(leaves.clear)
        through, stopped, deep = np.zeros((3, s))
        return cls(stamp_ns, stamp_ns, np.zeros((s, h)), np.zeros(s + 1), through, stopped, deep)

    def add(self, scan: SeenBy, sums: SightSums, sights: Sights, row: int) -> None:
        """Take in a sight."""
        look = scan.fresh * float(sights.looks[row])
        self.first_ns = min(scan.stamp_ns, self.first_ns)
        self.last_ns = max(scan.stamp_ns, self.last_ns)
        self.stands.add(scan.stand)
        seen = look * float(sums.seen[row])
        self.lasers[scan.laser] = self.lasers.get(scan.laser, 0.0) + seen
        self.scans += 1
        self.table += look * sums.tables[row]
        self.looks += seen
        self.through += look * sums.through[row]
        self.stopped += look * sums.stopped[row]
        self.deep += look * sums.deep[row]
        self.hidden += look * float(sights.hidden[row])
        self.near += look * float(sums.near[row])
        self.behind += look * float(sums.behind[row])
        self.sides.add(1 if sums.left[row] else -1)
        beside = scan.fresh * float(sights.side_looks[row])
        self.walls += beside * sums.walls[row]
        if row in sums.over:
            self.table += beside * sums.over[row]
        self.wall_looks += beside * float(sums.beside[row])

    def joint(self, leaves: Leaves, model: ScanModel) -> Floats:
        """Return (s, h): log p(what was seen, shift, stand of the leaves).

        However long a visit is, it is worth `most_looks` at most: what it sees is not independent.
        """
        walls = self.walls * (model.most_looks / (model.most_looks + self.wall_looks))
        in_line = np.logaddexp(
            np.log(model.wall_in_line) + walls[:-1], np.log(1 - model.wall_in_line) + walls[-1]
        )
        table = self.table * (model.most_looks / (model.most_looks + self.looks))
        return np.asarray(table + (LOG_WEIGHTS + in_line)[:, None] + leaves.log_prior)
