"""Open-RMF buildings (`*.building.yaml`, made by traffic_editor): named doors and lifts on levels.

The file draws on pictures: vertices are pixels, y down. Here they become metres of the building, y
up, in the one frame that Open-RMF gives all levels; a door's line starts at its first vertex.

The middle of a lift is drawn on its reference level, as a vertex is, and is the same on each level
of the building. Its doors are given in metres from there, x to its right and y to its front, turned
by its yaw; each is a door of every level that it serves.

The module also reads points that were measured in two maps, as CSV:
`old_x,old_y,new_x,new_y[,name]`, metres. In place of the old point a row may name a door, whose
line starts there: `door,new_x,new_y`.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

from semmap_log.analysis.rooms.room_graph import LIFT
from semmap_log.core.folds.rebasing import PointPair
from semmap_log.core.model.doors import MAX_LEVEL, Level
from semmap_log.errors import FormatError, UnknownDoorError
from semmap_log.interop.formats.files.building_frame import align_levels, reference_level
from semmap_log.interop.formats.files.building_level import LevelFrame, Storey, StoreyReader
from semmap_log.interop.formats.files.csv_blocks import Row, read_rows
from semmap_log.interop.formats.files.door_table import DoorTable, TableDoor
from semmap_log.interop.formats.files.floor_plan import Outlines, Segment, draw_floor
from semmap_log.interop.formats.parsing import yaml_values
from semmap_log.interop.formats.parsing.foreign_file import numbered_lines
from semmap_log.interop.formats.parsing.problems import Problems, shown
from semmap_log.interop.formats.parsing.strict_yaml import Mapping, Node, Scalar, load_yaml
from semmap_log.interop.formats.parsing.text_column import meant

PIXELS = "reference_image"
METRES = "cartesian_meters"


def read_building(
    path: Path, *, level: str | None = None, resolution: float = 0.05, lifts: bool = True
) -> DoorTable:
    """Return the building's doors, levels, floor plans and named places.

    Levels are numbered from 1 on in order of elevation, then name, also those that are left out.
    A lift's door is a door of each level that it serves, after the level's own; its annotation
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
    root = yaml_values.mapping_of(load_yaml(path), "a building", problems)
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
    """Give the levels their frames; return warnings about some."""
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
        node.line,
        f"coordinate_system: expected {PIXELS} or {METRES}, got {yaml_values.described(node)}",
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
    levels = yaml_values.mapping_of(node, "levels", problems)
    storeys = []
    for name, value in levels.entries.items() if levels else ():
        storey = yaml_values.mapping_of(value, f"level {shown(name)}", problems)
        if storey is not None:
            storeys.append(Storey(name, _elevation_m(name, storey, problems), storey))
    if len(storeys) > MAX_LEVEL:
        problems.add(node.line, f"expected at most {MAX_LEVEL:,} levels, got {len(storeys):,}")
    return sorted(storeys, key=lambda storey: (storey.elevation_m, storey.name))


def _elevation_m(name: str, storey: Mapping, problems: Problems) -> float:
    node = storey.entries.get("elevation")
    if node is None:
        return 0.0
    return yaml_values.number_of(node, f"level {shown(name)}: elevation", problems) or 0.0


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


OLD, NEW = ("old_x", "old_y"), ("new_x", "new_y")
MOST_LINE_BYTES = 65_536

DoorStart = Callable[[str], tuple[float, float]]
"""Gives where the line of a door starts in the old map, by its id or name."""


def read_pairs(path: Path, start_of: DoorStart) -> list[PointPair]:
    """Return the pairs of a file, in its order; one without a name is called by its line.

    Args:
        path: The CSV file.
        start_of: Where doors are in the old map; may raise `UnknownDoorError`.

    Raises:
        FormatError: The file cannot be read, or a row is wrong; names the lines.
    """
    problems = Problems(path)
    _, header = next(numbered_lines(path, most_bytes=MOST_LINE_BYTES), (1, ""))
    if "door" in [name.strip().lower() for name in header.split(",")]:
        pairs = list(_of_doors(path, problems, start_of))
    else:
        pairs = list(_of_points(path, problems))
    problems.raise_any()
    return pairs


def _of_points(path: Path, problems: Problems) -> Iterator[PointPair]:
    for row in _rows(path, problems, required=(*OLD, *NEW), optional=("name",)):
        numbers = [_metres(row, at, problems, (*OLD, *NEW)[at]) for at in range(4)]
        yield PointPair(meant(row.texts[4]) or f"line {row.line}", *numbers)


def _of_doors(path: Path, problems: Problems, start_of: DoorStart) -> Iterator[PointPair]:
    for row in _rows(path, problems, required=("door", *NEW), optional=()):
        new = [_metres(row, at, problems, ("door", *NEW)[at]) for at in (1, 2)]
        door = meant(row.texts[0].strip())
        try:
            yield PointPair(door, *start_of(door), *new)
        except UnknownDoorError as error:
            problems.add(row.line, str(error))


def _rows(
    path: Path, problems: Problems, *, required: tuple[str, ...], optional: tuple[str, ...]
) -> Iterator[Row]:
    for rows in read_rows(path, problems, required=required, optional=optional):
        yield from rows


def _metres(row: Row, at: int, problems: Problems, name: str) -> float:
    try:
        value = float(row.texts[at])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        problems.add(row.line, f"{name}: expected metres, got {shown(row.texts[at])}")
    return value


KINDS = {
    "1": "single_sliding",
    "2": "double_sliding",
    "3": "single_telescope",
    "4": "double_telescope",
}
"""What traffic_editor's numbers of a `door_type` mean."""


@dataclass(slots=True)
class FoundLifts:
    """What was read of a building's lifts."""

    doors: list[TableDoor] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class _CabinDoor:
    """A door of a cabin, in the cabin's frame."""

    line: int
    name: str
    middle: complex
    axis_rad: float
    width_m: float
    kind: str | None


class LiftsReader:
    """Reads the lifts. Problems are noted in `problems`; what has one is left out."""

    def __init__(self, root: Mapping, levels: Sequence[StoreyReader], problems: Problems) -> None:
        """Read nothing yet.

        Args:
            root: The building.
            levels: All of its levels.
            problems: Where problems are noted.
        """
        self._root = root
        self._levels = {level.storey.name: level for level in levels}
        self._problems = problems
        self._found = FoundLifts()
        self._names: set[tuple[int, str]] = set()

    def read(self, names: Collection[tuple[int, str]]) -> FoundLifts:
        """Return the lifts' doors, by lift, then level; each with a name of its own there.

        Args:
            names: The (level, name) of the building's other doors.
        """
        self._names = set(names)
        for name, node in self._entries(self._root, "lifts", "lifts").items():
            lift = yaml_values.mapping_of(node, f"lift {shown(name)}", self._problems)
            if lift is not None:
                self._lift(name, yaml_values.Fields(f"lift {shown(name)}", lift, self._problems))
        return self._found

    def _lift(self, name: str, lift: yaml_values.Fields) -> None:
        doors = self._cabin_doors(lift)
        served = list(self._served(lift, doors))
        if not name or not served:
            why = "serves no level by a door" if name else "has no name"
            self._found.left_out.append(f"lift {name}: it {why}")
            return
        home = self._reference(lift)
        middle = (
            home.placed(lift.number("x"), lift.number("y"), lift.mapping.line, what=lift.what)
            if home
            else None
        )
        yaw = lift.number("yaw")
        if home is None or middle is None:
            return
        for level, door_names in served:
            for door_name in door_names:
                door = doors[door_name]
                at = complex(*middle) + cmath.rect(1.0, yaw) * door.middle
                self._found.doors.append(self._door(name, level, door, at, yaw))

    def _door(
        self, lift: str, level: StoreyReader, door: _CabinDoor, middle: complex, yaw: float
    ) -> TableDoor:
        """Return a cabin's door on a level."""
        theta = cmath.phase(cmath.rect(1.0, yaw + door.axis_rad))
        start = middle - cmath.rect(door.width_m / 2, theta)
        annotations = {"name": self._name(lift, door.name, level.number)}
        if door.kind is not None:
            annotations["kind"] = door.kind
        annotations[LIFT] = lift
        return TableDoor(
            line=door.line, door_id=None, level=level.number,
            x=start.real, y=start.imag, theta=theta, width=door.width_m, annotations=annotations,
        )  # fmt: skip

    def _name(self, lift: str, door: str, level: int) -> str:
        """Return a name that no other door of the level has: it begins with the lift's."""
        wanted = door if door.casefold().startswith(lift.casefold()) else f"{lift}_{door}"
        numbered = (wanted if number == 1 else f"{wanted}_{number}" for number in count(1))
        name = next(each for each in numbered if (level, each) not in self._names)
        self._names.add((level, name))
        return name

    def _cabin_doors(self, lift: yaml_values.Fields) -> dict[str, _CabinDoor]:
        doors = {}
        for name, node in self._entries(lift.mapping, "doors", f"{lift.what}: doors").items():
            what = f"{lift.what}: door {shown(name)}"
            mapping = yaml_values.mapping_of(node, what, self._problems)
            if mapping is not None:
                doors[name] = self._cabin_door(
                    name, yaml_values.Fields(what, mapping, self._problems)
                )
        return doors

    def _cabin_door(self, name: str, door: yaml_values.Fields) -> _CabinDoor:
        axis = door.mapping.entries.get("motion_axis_orientation")
        width_m = door.number("width")
        if width_m <= 0:
            door.refuse("width", "metres above 0")
        kind = door.mapping.entries.get("door_type")
        return _CabinDoor(
            door.mapping.line,
            name,
            complex(door.number("x"), door.number("y")),
            (
                yaml_values.number_of(axis, f"{door.what}: motion_axis_orientation", self._problems)
                or 0.0
            )
            if axis
            else 0.0,
            width_m,
            KINDS.get(kind.text) if isinstance(kind, Scalar) else None,
        )

    def _served(
        self, lift: yaml_values.Fields, doors: dict[str, _CabinDoor]
    ) -> Iterator[tuple[StoreyReader, list[str]]]:
        """Yield the levels that a lift serves, with the names of its doors there."""
        what = f"{lift.what}: level_doors"
        for name, node in self._entries(lift.mapping, "level_doors", what).items():
            level = self._levels.get(name)
            if level is None:
                known = ", ".join(self._levels) or "(none)"
                self._problems.add(
                    node.line, f"{what}: expected one of the levels {known}; got {shown(name)}"
                )
                continue
            names = list(dict.fromkeys(self._texts(node, what)))
            for each in names:
                if each not in doors:
                    known = ", ".join(doors) or "(none)"
                    self._problems.add(
                        node.line, f"{what}: expected one of the doors {known}; got {shown(each)}"
                    )
            if names := [each for each in names if each in doors]:
                yield level, names

    def _reference(self, lift: yaml_values.Fields) -> StoreyReader | None:
        """Return the level on which a lift is drawn; the building's reference level by default."""
        node = lift.mapping.entries.get("reference_floor_name")
        if node is None:
            return reference_level(self._root, [*self._levels.values()], self._problems)
        name = yaml_values.text_of(node, f"{lift.what}: reference_floor_name", self._problems)
        if name is not None and name not in self._levels:
            known = ", ".join(self._levels)
            self._problems.add(
                node.line,
                f"{lift.what}: reference_floor_name: expected one of the levels {known}; "
                f"got {shown(name)}",
            )
        return self._levels.get(name or "")

    def _entries(self, mapping: Mapping, key: str, what: str) -> dict[str, Node]:
        """Return the keys and values of a mapping in a mapping; none where there is nothing."""
        node = mapping.entries.get(key)
        if node is None or (isinstance(node, Scalar) and node.value is None):
            return {}
        found = yaml_values.mapping_of(node, what, self._problems)
        return found.entries if found else {}

    def _texts(self, node: Node, what: str) -> Iterator[str]:
        found = yaml_values.sequence_of(node, what, self._problems)
        for item in found.items if found else ():
            text = yaml_values.text_of(item, what, self._problems)
            if text is not None:
                yield text
