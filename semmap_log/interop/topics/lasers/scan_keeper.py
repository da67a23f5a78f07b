"""Keeps the scans of the visits that end, with the door's line as it was."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Sequence

from semmap_log.analysis.scans.kept_visit import DoorLine, visit_key
from semmap_log.analysis.scans.placed_scan import DoorPlaces, PlacedScan
from semmap_log.analysis.scans.recent_scans import RecentScans
from semmap_log.analysis.scans.visit import Visit
from semmap_log.errors import OutputError
from semmap_log.interop.formats.kept_scans.writing import KeptScansWriter

Places = Mapping[int, tuple[DoorLine, int]]
"""Door -> its line and its level."""


class ScanKeeper:
    """Is told of all scans, and of each visit once it has ended."""

    def __init__(
        self,
        writer: KeptScansWriter,
        *,
        known: Container[tuple[object, ...]] = (),
        tell: Callable[[str], None] | None = None,
    ) -> None:
        """Keep visits.

        Args:
            writer: Takes them.
            known: Keys of visits that are kept already: see `visit_key`.
            tell: Told once that nothing can be written, and nothing more is kept; None: that is
                an error.
        """
        self._writer: KeptScansWriter | None = writer
        self._known, self._tell = known, tell
        self._recent = RecentScans()
        self._doors: DoorPlaces | None = None
        self._now: Places = {}
        """Of all doors that were ever there, as they were last."""
        self._before: Places = {}
        """The same, until `_since_ns`."""
        self._since_ns = 0

    def saw(self, scans: Sequence[PlacedScan], doors: DoorPlaces) -> None:
        """Take scans, in the order of their stamps, through all of which the doors are these."""
        if doors is not self._doors and scans:
            self._doors, self._since_ns = doors, scans[0].stamp_ns
            self._before, self._now = self._now, {**self._now, **_places(doors)}
        self._recent.forget_old()  # before those come, however many, and before their visits end
        for scan in scans:
            self._recent.take(scan)

    def keep(self, visits: Iterable[Visit]) -> None:
        """Keep visits that have ended; one ends before its door changes.

        Raises:
            OutputError: They cannot be written, and nobody wants to be told instead.
        """
        for visit in visits:
            if visit_key(visit) not in self._known:
                self._keep(visit)

    def _keep(self, visit: Visit) -> None:
        if self._writer is None:
            return
        began_before = visit.first_ns < self._since_ns and visit.door_id in self._before
        line, level = (self._before if began_before else self._now)[visit.door_id]
        try:
            self._writer.keep(visit, line=line, level=level, scans=self._recent.of(visit))
        except OutputError as error:
            if self._tell is None:
                raise
            self._writer.abandon()
            self._writer = None
            self._tell(f"no more scans are kept: {error}")


def _places(doors: DoorPlaces) -> Places:
    rows = zip(doors.ids.tolist(), doors.levels.tolist(), doors.lines.tolist(), strict=True)
    return {door_id: ((x, y, theta, width), level) for door_id, level, (x, y, theta, width) in rows}
