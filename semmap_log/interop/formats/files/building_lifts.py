"""The lifts of an Open-RMF building: their doors, on each level that they serve.

The middle of a lift is drawn on its reference level, as a vertex is, and is the same on each level
of the building. Its doors are given in metres from there, x to its right and y to its front, turned
by its yaw.
"""

from __future__ import annotations

import cmath
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count

from semmap_log.analysis.rooms.room_names import LIFT
from semmap_log.interop.formats.files.building_frame import reference_level
from semmap_log.interop.formats.files.building_level import StoreyReader
from semmap_log.interop.formats.files.door_table import TableDoor
from semmap_log.interop.formats.parsing.problems import Problems, shown
from semmap_log.interop.formats.parsing.strict_yaml import Mapping, Node, Scalar
from semmap_log.interop.formats.parsing.yaml_values import (
    Fields,
    mapping_of,
    number_of,
    sequence_of,
    text_of,
)

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
            lift = mapping_of(node, f"lift {shown(name)}", self._problems)
            if lift is not None:
                self._lift(name, Fields(f"lift {shown(name)}", lift, self._problems))
        return self._found

    def _lift(self, name: str, lift: Fields) -> None:
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

    def _cabin_doors(self, lift: Fields) -> dict[str, _CabinDoor]:
        doors = {}
        for name, node in self._entries(lift.mapping, "doors", f"{lift.what}: doors").items():
            what = f"{lift.what}: door {shown(name)}"
            mapping = mapping_of(node, what, self._problems)
            if mapping is not None:
                doors[name] = self._cabin_door(name, Fields(what, mapping, self._problems))
        return doors

    def _cabin_door(self, name: str, door: Fields) -> _CabinDoor:
        axis = door.mapping.entries.get("motion_axis_orientation")
        width_m = door.number("width")
        if width_m <= 0:
            door.refuse("width", "metres above 0")
        kind = door.mapping.entries.get("door_type")
        return _CabinDoor(
            door.mapping.line,
            name,
            complex(door.number("x"), door.number("y")),
            (number_of(axis, f"{door.what}: motion_axis_orientation", self._problems) or 0.0)
            if axis
            else 0.0,
            width_m,
            KINDS.get(kind.text) if isinstance(kind, Scalar) else None,
        )

    def _served(
        self, lift: Fields, doors: dict[str, _CabinDoor]
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

    def _reference(self, lift: Fields) -> StoreyReader | None:
        """Return the level on which a lift is drawn; the building's reference level by default."""
        node = lift.mapping.entries.get("reference_floor_name")
        if node is None:
            return reference_level(self._root, [*self._levels.values()], self._problems)
        name = text_of(node, f"{lift.what}: reference_floor_name", self._problems)
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
        found = mapping_of(node, what, self._problems)
        return found.entries if found else {}

    def _texts(self, node: Node, what: str) -> Iterator[str]:
        found = sequence_of(node, what, self._problems)
        for item in found.items if found else ():
            text = text_of(item, what, self._problems)
            if text is not None:
                yield text
