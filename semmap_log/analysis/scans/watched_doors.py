"""The doors of a moment, made ready to be looked at."""

from __future__ import annotations

import numpy as np

from semmap_log.analysis.scans.door_grid import DoorGrid
from semmap_log.analysis.scans.leaves import Leaves, leaves_of
from semmap_log.analysis.scans.placed_scan import DoorPlaces
from semmap_log.analysis.scans.scan_model import ScanModel


class WatchedDoors:
    """Doors by place, by id and by kind."""

    def __init__(self, doors: DoorPlaces, model: ScanModel) -> None:
        self.places = doors
        self.ids, self.lines, self.glass = doors.ids, doors.lines, doors.glass
        self.grid = DoorGrid(doors, reach=model.reach)
        self.leaves = [leaves_of(kind) for kind in doors.kinds]
        self.kinds: list[Leaves] = list({id(leaves): leaves for leaves in self.leaves}.values())
        number = {id(leaves): i for i, leaves in enumerate(self.kinds)}
        self.kind = np.array([number[id(leaves)] for leaves in self.leaves], np.intp)
        self.row_of = {door_id: row for row, door_id in enumerate(doors.ids.tolist())}

    def changed_since(self, before: WatchedDoors) -> list[int]:
        """Return the ids of those doors of `before` that are gone or otherwise now."""
        return [
            door_id
            for door_id, row in before.row_of.items()
            if (now := self.row_of.get(door_id)) is None or self._says(now) != before._says(row)
        ]

    def _says(self, row: int) -> tuple[object, ...]:
        """Return all that a visit to the door rests on."""
        places = self.places
        line = tuple(places.lines[row].tolist())
        return int(places.levels[row]), line, places.kinds[row], bool(places.glass[row])
