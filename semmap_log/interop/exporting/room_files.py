"""Rooms as a file for other programs: written whole, or not at all."""

from __future__ import annotations

from pathlib import Path

from semmap_log.analysis.rooms.level_rooms import RoomPlan
from semmap_log.core.folds.levels import OPTION, told
from semmap_log.core.io.disk import atomic_file, check_outside_log, output_errors
from semmap_log.errors import FormatError, UnknownLevelError
from semmap_log.interop.exporting.log_files import about
from semmap_log.interop.formats.files.geojson import dump_room_geojson
from semmap_log.interop.formats.files.topological_map import dump_topological_map
from semmap_log.log import DoorLog

WRITABLE = ".geojson (rooms as polygons), .tmap2.yaml (a topological map)"


def write_rooms(log: DoorLog, plan: RoomPlan, out: Path, *, level: int | None = None) -> None:
    """Write a file in the format of its extension; an old file of that name is replaced at once.

    Args:
        log: Whose rooms they are.
        plan: The rooms, of any moment.
        out: The file.
        level: Only the rooms of that one; None: of all.

    Raises:
        FormatError: The name has no known extension.
        UnknownLevelError: A topological map has one level, and several have a floor plan.
        OutputError: The file cannot be written; what was there is whole.
    """
    check_outside_log(log.path, out)
    if out.name.lower().endswith(".geojson"):
        text = dump_room_geojson(plan, about(log), level=level)
    elif out.name.lower().endswith((".tmap2.yaml", ".tmap2")):
        name = log.info.building or log.path.name
        text = dump_topological_map(plan, _only_level(plan, level), name=name)
    else:
        raise FormatError(out, f"unknown extension for rooms; expected one of: {WRITABLE}.")
    with output_errors(out), atomic_file(out) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _only_level(plan: RoomPlan, level: int | None) -> int:
    """Return the level of a file that can have one only."""
    if level is not None:
        return level
    if len(plan.levels) > 1:
        names = {n: plan.door_map.level_name(n) for n in plan.levels}
        raise UnknownLevelError(
            f"a topological map has one level, and the log has {told(names)}; say which: {OPTION}."
        )
    return next(iter(plan.levels))
