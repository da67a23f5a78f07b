"""Proposed doors beside the doorways that are there: which are found, and how far off they lie."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, degrees, hypot, radians, sin

import numpy as np

from scan_eval.ratios import Estimate, ratio
from semmap_log.analysis.scans.proposing.proposals import Proposal

HINGED = "hinged"
NEAR_M, TURNED = 0.5, radians(20)
"""So near to a doorway's middle, and so little turned against it, a proposal is that doorway."""


@dataclass(frozen=True, slots=True)
class Doorway:
    """A doorway that is there."""

    x: float
    y: float
    theta: float
    width: float
    kind: str = ""
    """As of a door; empty: nobody knows."""
    hinge_at_end: bool = False
    """The leaf hangs at the end of the line, not at its start."""
    is_seen: bool = True
    """Beams went through: what was shut all the time cannot be found."""

    @property
    def middle(self) -> tuple[float, float]:
        """Of the line, m."""
        return self._at(self.width / 2)

    @property
    def hinge(self) -> tuple[float, float]:
        """Where the leaf hangs, m."""
        return self._at(self.width if self.hinge_at_end else 0.0)

    def _at(self, along: float) -> tuple[float, float]:
        return self.x + along * cos(self.theta), self.y + along * sin(self.theta)


@dataclass(frozen=True, slots=True)
class Drive:
    """What one drive through a building showed."""

    doorways: Sequence[Doorway]
    proposals: Sequence[Proposal]

    @property
    def pairs(self) -> list[tuple[Doorway, Proposal]]:
        """Each doorway with the proposal that is it, one to one, the nearest first."""
        near = sorted(
            (far, d, p)
            for d, doorway in enumerate(self.doorways)
            for p, proposal in enumerate(self.proposals)
            if (far := _apart_m(doorway, proposal)) < NEAR_M and _is_along(doorway, proposal)
        )
        pairs: dict[int, int] = {}
        for _, d, p in near:
            if d not in pairs and p not in pairs.values():
                pairs[d] = p
        return [(self.doorways[d], self.proposals[p]) for d, p in sorted(pairs.items())]


def figures(drives: Sequence[Drive]) -> dict[str, object]:
    """Return counts, and errors with their standard errors over drives; lengths m, angles deg."""
    pairs = [drive.pairs for drive in drives]
    found = [len(each) for each in pairs]
    seen_found = [sum(d.is_seen for d, _ in each) for each in pairs]
    seen = [sum(d.is_seen for d in drive.doorways) for drive in drives]
    every = [len(drive.proposals) for drive in drives]
    widths = [[p.width - d.width for d, p in each] for each in pairs]
    hinged = [(d, p) for each in pairs for d, p in each if p.kind == HINGED and d.kind]
    return {
        "doorways": sum(len(drive.doorways) for drive in drives),
        "found": sum(found),
        "seen": sum(seen),
        "seen_found": sum(seen_found),
        "others": sum(every) - sum(found),
        "recall": ratio(seen_found, seen),
        "precision": ratio(found, every),
        "centre_m": _mean([[_apart_m(d, p) for d, p in each] for each in pairs]),
        "width_m": _mean(widths),
        "width_off_m": _mean([[abs(off) for off in each] for each in widths]),
        "width_median_m": _median([off for each in widths for off in each]),
        "angle_deg": _mean([[degrees(_turned(d, p)) for d, p in each] for each in pairs]),
        "said_hinged": len(hinged),
        "hinged": sum(d.kind == HINGED for d, _ in hinged),
        "hinge_right": sum(_hangs_there(d, p) for d, p in hinged),
    }


def _hangs_there(doorway: Doorway, proposal: Proposal) -> bool:
    """Tell whether a leaf truly hangs at the start of the proposed line."""
    x, y = doorway.hinge
    is_there = hypot(x - proposal.x, y - proposal.y) < proposal.width / 2
    return doorway.kind == HINGED and is_there


def _apart_m(doorway: Doorway, proposal: Proposal) -> float:
    (x, y), (at_x, at_y) = doorway.middle, proposal.middle
    return hypot(x - at_x, y - at_y)


def _turned(doorway: Doorway, proposal: Proposal) -> float:
    """Return by how much their lines are turned against each other, rad: 0 to a quarter turn."""
    return abs(math.remainder(proposal.theta - doorway.theta, math.pi))


def _is_along(doorway: Doorway, proposal: Proposal) -> bool:
    return _turned(doorway, proposal) < TURNED


def _mean(values: Sequence[Sequence[float]]) -> Estimate:
    return ratio([sum(each) for each in values], [len(each) for each in values])


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else math.nan
