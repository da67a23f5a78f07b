"""Open-RMF buildings (`*.building.yaml`, made by traffic_editor): named doors and lifts on levels.

The file draws on pictures: vertices are pixels, y down. Here they become metres of the building, y
up, in the one frame that Open-RMF gives all levels; a door's line starts at its first vertex.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from semmap_log.core.model.doors import MAX_LEVEL, Level
from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.building_frame import align_levels, reference_level
from semmap_log.interop.formats.files.building_level import LevelFrame, Storey, StoreyReader
from semmap_log.interop.formats.files.building_lifts import FoundLifts, LiftsReader
from semmap_log.interop.formats.files.door_table import DoorTable, TableDoor
from semmap_log.interop.formats.files.floor_plan import Outlines, Segment, draw_floor
from semmap_log.interop.formats.parsing.problems import Problems, shown
from semmap_log.interop.formats.parsing.strict_yaml import Mapping, Scalar, load_yaml
from semmap_log.interop.formats.parsing.yaml_values import described, mapping_of, number_of

PIXELS = "reference_image"
METRES = "cartesian_meters"


def read_building(
    path: Path, *, level: str | None = None, resolution: float = 0.05, lifts: bool = True
) -> DoorTable:
    """Return the building's doors, levels, floor plans and named places.

    Levels are numbered from 1 on in order of elevation, then name, whether asked for or not. A
    lift's door is a door of each level that it serves, behind the level's own; its annotation
    `lift` is the lift's name.

    Args:
        path: The `*.building.yaml` file.
        level: Only the level of that name; None: all of them.
        resolution: Metres a cell of the floor plans.
        lifts: With the doors of lifts.

    Raises:
        FormatError: The file cannot be read, is not such a building, or has no such level.
    """
    problems = Problems(path)
    root, all_levels, readers, warnings = _level_readers(path, level, problems)
    doors = [door for reader in readers for door in reader.doors()]
    found = _lifts(root, all_levels, problems) if lifts else FoundLifts()
    unnamed = sum("name" not in door.annotations for door in doors)
    if unnamed:
        warnings.append(
            f"doors without a name: {unnamed:,}; added under ids, and known by their places when "
            "the building is imported again"
        )
    numbers = {reader.number for reader in readers}
    at_lifts = [door for door in found.doors if door.level in numbers]
    plans = {reader.number: reader.outlines(_lines(at_lifts, reader.number)) for reader in readers}
    places = [place for reader in readers for place in reader.places()]
    problems.raise_any()
    maps = [
        draw_floor(plan, level=number, resolution=resolution, path=path)
        for number, plan in plans.items()
        if plan.walls
    ]
    levels = [Level(r.number, r.storey.name, r.storey.elevation_m) for r in readers]
    return DoorTable(
        path, (*doors, *at_lifts), tuple(levels), tuple(maps), tuple(found.left_out),
        tuple(warnings), tuple(places),
    )  # fmt: skip


def read_outlines(path: Path) -> dict[int, Outlines]:
    """Return each level's walls, own doors and floors, by the numbers of `read_building`.

    Raises:
        FormatError: The file cannot be read, or is not such a building.
    """
    problems = Problems(path)
    _, readers, _, _ = _level_readers(path, None, problems)
    outlines = {reader.number: reader.outlines() for reader in readers}
    problems.raise_any()
    return outlines


def _level_readers(
    path: Path, level: str | None, problems: Problems
) -> tuple[Mapping, list[StoreyReader], list[StoreyReader], list[str]]:
    """Return the file's root, what reads its levels, those of that name or all, and warnings.

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
    ]
    chosen = [reader for reader in readers if level in (None, reader.storey.name)]
    if level is not None and not chosen:
        names = ", ".join(storey.name for storey in storeys) or "(none)"
        raise FormatError(path, f"expected one of the levels {names}; got {shown(level)}")
    warnings = _align(root, readers, problems)
    said = [warnings[reader.number] for reader in chosen if reader.number in warnings]
    return root, readers, chosen, said


def _align(root: Mapping, readers: list[StoreyReader], problems: Problems) -> dict[int, str]:
    """Give the levels their frames; return what has to be said of some."""
    if readers and readers[0].in_pixels:
        reference = reference_level(root, readers, problems)
        return {} if reference is None else align_levels(readers, reference, problems)
    for reader in readers:
        reader.frame = LevelFrame()
    return {}


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


def _lifts(root: Mapping, levels: list[StoreyReader], problems: Problems) -> FoundLifts:
    """Return the doors of the building's lifts."""
    reader = LiftsReader(root, levels, problems)
    return reader.read({(level.number, name) for level in levels for name in level.door_names})


def _lines(doors: list[TableDoor], level: int) -> Iterator[Segment]:
    """Yield the lines of a level's doors."""
    for door in doors:
        if door.level == level:
            end = (
                door.x + door.width * math.cos(door.theta),
                door.y + door.width * math.sin(door.theta),
            )
            yield (door.x, door.y), end
