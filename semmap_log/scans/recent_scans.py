"""The scans of the last half minute: a visit that ends is asked for those that it was made from."""

from __future__ import annotations

from collections import defaultdict, deque

from semmap_log.scans.placed_scan import PlacedScan
from semmap_log.scans.visit import Visit

KEPT_NS = 40 * 10**9
"""A visit takes 20 s and ends 5 s behind its last scan, or when its door changes."""


class RecentScans:
    """Holds the scans of each laser of each robot for a while."""

    def __init__(self, kept_ns: int = KEPT_NS) -> None:
        self._kept_ns = kept_ns
        self._of: defaultdict[tuple[str, str], deque[PlacedScan]] = defaultdict(deque)

    def take(self, scan: PlacedScan) -> None:
        """Take the next scan of its laser."""
        self._of[scan.robot, scan.laser].append(scan)

    def forget_old(self) -> None:
        """Let go of scans that no visit is made from that is still going on."""
        for here in self._of.values():
            while here[0].stamp_ns < here[-1].stamp_ns - self._kept_ns:
                here.popleft()

    def of(self, visit: Visit) -> list[PlacedScan]:
        """Return the scans between the first and the last that the visit was made from."""
        here = self._of.get((visit.robot, visit.laser), ())
        return [scan for scan in here if visit.first_ns <= scan.stamp_ns <= visit.last_ns]
