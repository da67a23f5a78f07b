"""Open-RMF buildings (`*.building.yaml`, made by traffic_editor): named doors on levels.

The file draws on a picture: vertices are pixels, y down. Here they become metres, y up, by the
scale of each level's own measurements; a door's line starts at its first vertex.
"""

from __future__ import annotations

from pathlib import Path

from semmap_log.domain.doors import MAX_LEVEL, Level
from semmap_log.errors import FormatError
from semmap_log.formats.files.building_level import Storey, StoreyReader
from semmap_log.formats.files.door_table import DoorTable
from semmap_log.formats.files.floor_plan import Outlines, draw_floor
from semmap_log.formats.parsing.problems import Problems, shown
from semmap_log.formats.parsing.strict_yaml import Mapping, Node, Scalar, load_yaml
from semmap_log.formats.parsing.yaml_values import described, mapping_of, number_of

PIXELS = "reference_image"
METRES = "cartesian_meters"


def read_building(path: Path, *, level: str | None = None, resolution: float = 0.05) -> DoorTable:
    """Return the building's doors, levels and floor plans.

    Levels are numbered from 1 on in order of elevation, then name, whether asked for or not.

    Args:
        path: The `*.building.yaml` file.
        level: Only the level of that name; None: all of them.
        resolution: Metres a cell of the floor plans.

    Raises:
        FormatError: The file cannot be read, is not such a building, or has no such level.
    """
    problems = Problems(path)
    root, readers = _level_readers(path, level, problems)
    doors = [door for reader in readers for door in reader.doors()]
    plans = {reader.number: reader.outlines() for reader in readers}
    problems.raise_any()
    maps = [
        draw_floor(plan, level=number, resolution=resolution, path=path)
        for number, plan in plans.items()
        if plan.walls
    ]
    levels = [Level(r.number, r.storey.name, r.storey.elevation_m) for r in readers]
    return DoorTable(path, tuple(doors), tuple(levels), tuple(maps), tuple(_lifts(root)))


def read_outlines(path: Path) -> dict[int, Outlines]:
    """Return each level's walls, doors and floors as lines, by the numbers of `read_building`.

    Raises:
        FormatError: The file cannot be read, or is not such a building.
    """
    problems = Problems(path)
    _, readers = _level_readers(path, None, problems)
    outlines = {reader.number: reader.outlines() for reader in readers}
    problems.raise_any()
    return outlines


def _level_readers(
    path: Path, level: str | None, problems: Problems
) -> tuple[Mapping, list[StoreyReader]]:
    """Return the file's root, and what reads its levels: of that name, or all.

    Raises:
        FormatError: The file cannot be read, is not such a building, or has no such level.
    """
    root = mapping_of(load_yaml(path), "a building", problems)
    problems.raise_any()
    assert root is not None
    in_pixels = _in_pixels(root, problems)
    storeys = _storeys(root, problems)
    problems.raise_any()
    readers = [
        StoreyReader(n, storey, problems, in_pixels=in_pixels)
        for n, storey in enumerate(storeys, start=1)
        if level in (None, storey.name)
    ]
    if level is not None and not readers:
        names = ", ".join(storey.name for storey in storeys) or "(none)"
        raise FormatError(path, f"expected one of the levels {names}; got {shown(level)}")
    return root, readers


def _in_pixels(root: Mapping, problems: Problems) -> bool:
    """Return whether vertices are pixels with y down, rather than metres with y up."""
    node = root.entries.get("coordinate_system")
    if node is None:
        return True
    if isinstance(node, Scalar) and node.value in (PIXELS, METRES):
        return node.value == PIXELS
    problems.add(
        node.line, f"coordinate_system: expected {PIXELS} or {METRES}, got {described(node)}"
    )
    return True


def _storeys(root: Mapping, problems: Problems) -> list[Storey]:
    """Return the building's levels, lowest first."""
    node = root.entries.get("levels")
    if node is None:
        problems.add(
            root.line, "expected an Open-RMF building, which has the key levels; this file has none"
        )
        return []
    levels = mapping_of(node, "levels", problems)
    storeys = []
    for name, value in levels.entries.items() if levels else ():
        storey = mapping_of(value, f"level {shown(name)}", problems)
        if storey is not None:
            storeys.append(Storey(name, _elevation_m(name, storey, problems), storey))
    if len(storeys) > MAX_LEVEL:
        problems.add(node.line, f"expected at most {MAX_LEVEL:,} levels, got {len(storeys):,}")
    return sorted(storeys, key=lambda storey: (storey.elevation_m, storey.name))


def _elevation_m(name: str, storey: Mapping, problems: Problems) -> float:
    node = storey.entries.get("elevation")
    if node is None:
        return 0.0
    return number_of(node, f"level {shown(name)}: elevation", problems) or 0.0


def _lifts(root: Mapping) -> list[str]:
    """Return a line for each lift of the building, in words."""
    node: Node | None = root.entries.get("lifts")
    lifts = node.entries if isinstance(node, Mapping) else {}
    said = []
    for name, lift in lifts.items():
        doors = lift.entries.get("doors") if isinstance(lift, Mapping) else None
        own = ", ".join(doors.entries) if isinstance(doors, Mapping) else ""
        said.append(f"lift {name}{f' with its doors ({own})' if own else ''}: lifts are left out")
    return said
