"""A rebase told by files: the new map, pairs of points, and doors that were measured again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from semmap_log.core.folds.levels import resolve_level
from semmap_log.core.model.doors import DoorMap
from semmap_log.core.model.events import FloorMap
from semmap_log.core.model.rigid_transform import RigidTransform
from semmap_log.errors import UnknownDoorError
from semmap_log.interop.formats.files.point_pairs import DoorStart, read_pairs
from semmap_log.interop.importing.measured_doors import MeasuredDoors, read_measured_doors
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.door_log.door_names import resolve_door
from semmap_log.log.door_log.map_fit import MOST_RESIDUAL_M, MapFit, fit_maps
from semmap_log.log.door_log.rebase_command import rebase_plan
from semmap_log.log.door_log.rebasing import RebasePlan
from semmap_log.log.replay.replay import Scope

NONE_MEASURED = MeasuredDoors({}, ())


@dataclass(frozen=True, slots=True)
class RebaseMoment:
    """What the log holds when the new map comes."""

    log: DoorLog
    door_map: DoorMap
    level: int
    """Whose map it is."""
    at_ns: int | None
    """None: now."""
    event: int | None
    """Only events up to that number count; None: all."""

    @classmethod
    def of(
        cls, log: DoorLog, level: str | None, *, at_ns: int | None, before_event: int | None = None
    ) -> RebaseMoment:
        """Return it.

        Args:
            log: The log.
            level: Number or name; None: the only one.
            at_ns: When the new map comes; None: now.
            before_event: The first event of the commit, if it is there already: what it was made
                of is what was there before.

        Raises:
            UnknownLevelError: There is no such level, or there are several and none is told.
        """
        event = None if before_event is None else before_event - 1
        door_map = log.state_in(Scope(at_ns=at_ns, event=event)).door_map()
        now = log.state_in(Scope(event=event)).door_map()
        return cls(log, door_map, resolve_level(level, now), at_ns, event)

    def fit(self, pairs: Path, *, most_residual_m: float = MOST_RESIDUAL_M) -> MapFit:
        """Return the transform that fits the pairs of a file, and how well; see `check_fit`.

        Raises:
            FormatError: The file cannot be read.
            CommandError: Its pairs tell no transform.
        """
        return fit_maps(read_pairs(pairs, self._start_of()), most_residual_m=most_residual_m)

    def measured(self, path: Path | None) -> MeasuredDoors:
        """Return where a file puts the level's doors; None: there is no file.

        Raises:
            FormatError: It cannot be read, or has no door of the level.
        """
        if path is None:
            return NONE_MEASURED
        return read_measured_doors(path, self.door_map, level=self.level)

    def plan(self, floor: FloorMap, by: RigidTransform, measured: MeasuredDoors) -> RebasePlan:
        """Return what the rebase does.

        Raises:
            CommandError: As for `plan_rebase`.
        """
        return rebase_plan(
            self.log, floor, by, measured.doors, level=self.level, at_ns=self.at_ns,
            event=self.event,
        )  # fmt: skip

    def _start_of(self) -> DoorStart:
        def start_of(text: str) -> tuple[float, float]:
            door = self.door_map.doors.get(resolve_door(text, self.door_map))
            if door is None or door.level != self.level or not door.is_placed:
                raise UnknownDoorError(
                    f"door {text!r}: expected one with a place on level "
                    f"{self.door_map.level_name(self.level)} before the new map came"
                )
            return door.start

        return start_of
