"""The scans of the last minute: a visit that ends is asked for those that it was made from."""

from __future__ import annotations

from collections import defaultdict, deque

from semmap_log.analysis.scans.placed_scan import PlacedScan
from semmap_log.analysis.scans.scan_model import DEFAULT
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.moments import SECOND_NS

KEPT_NS = round((DEFAULT.longest_s + DEFAULT.pause_s) * SECOND_NS)
"""A visit that takes longest ends so long after its first scan."""


class RecentScans:
    """Holds the scans of each laser of each robot for a while."""

    def __init__(self, kept_ns: int = KEPT_NS) -> None:
        self._kept_ns = kept_ns
        self._of: defaultdict[tuple[str, str], deque[PlacedScan]] = defaultdict(deque)

    def take(self, scan: PlacedScan) -> None:
        """Take the next scan of its laser."""
        self._of[scan.robot, scan.laser].append(scan)

    def forget_old(self) -> None:
        """Let go of scans that no visit is made from that is still going on.

        After a clock was set back those of before end none: their visits have ended.
        """
        for here in self._of.values():
            last_ns = here[-1].stamp_ns
            while not last_ns - self._kept_ns <= here[0].stamp_ns <= last_ns:
                here.popleft()

    def of(self, visit: Visit) -> list[PlacedScan]:
        """Return the scans between the first and the last that the visit was made from."""
        here = self._of.get((visit.robot, visit.laser), ())
        return [scan for scan in here if visit.first_ns <= scan.stamp_ns <= visit.last_ns]
