"""What a laser saw of all doors, for who wants to know how far to trust it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from semmap_log.analysis.scans.door_figures import DoorFigures, door_figures
from semmap_log.analysis.scans.door_warnings import DoorWarning, door_warnings
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.doors import DoorId


@dataclass(frozen=True, slots=True)
class ScanReport:
    """The figures and warnings of each door."""

    doors: Sequence[DoorFigures]
    """Of those that were visited, ids ascending."""
    warnings: Sequence[DoorWarning]
    not_met: Sequence[DoorId]
    """Doors that have a place, and were never visited."""
    labels: Mapping[DoorId, str]
    """What doors are called that have a name."""
    summary: Sequence[str] = ()
    """What there was of scans."""
    oddities: Sequence[str] = ()
    """What is odd about the scans, beside the doors."""

    def label(self, door_id: DoorId) -> str:
        """Return what to call a door."""
        return self.labels.get(door_id) or str(door_id)

    def warnings_of(self, door_id: DoorId) -> list[DoorWarning]:
        """Return the warnings about a door."""
        return [warning for warning in self.warnings if warning.door_id == door_id]


def scan_report(
    visits: Iterable[Visit],
    *,
    labels: Mapping[DoorId, str],
    placed: Collection[DoorId],
    glass: Collection[DoorId] = (),
    summary: Sequence[str] = (),
    oddities: Sequence[str] = (),
) -> ScanReport:
    """Return the report of some visits.

    Args:
        visits: To any doors.
        labels: What doors are called.
        placed: Doors that could have been met.
        glass: Those that are known to be of glass.
        summary: What there was of scans.
        oddities: What is odd about them.
    """
    doors = door_figures(visits)
    met = {door.door_id for door in doors}
    return ScanReport(
        doors=doors,
        warnings=door_warnings(doors, glass=glass),
        not_met=sorted(door_id for door_id in placed if door_id not in met),
        labels=labels,
        summary=summary,
        oddities=oddities,
    )
