"""One level of an Open-RMF building: its vertices, scale, doors, walls and floors."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from semmap_log.core.lazily import computed_once
from semmap_log.interop.formats.files.door_table import TableDoor, TablePlace
from semmap_log.interop.formats.files.floor_plan import Outlines, Point, Segment
from semmap_log.interop.formats.parsing import yaml_values
from semmap_log.interop.formats.parsing.problems import Problems, shown
from semmap_log.interop.formats.parsing.strict_yaml import Mapping, Node, Scalar, Sequence

FARTHEST_M = 100_000.0
"""A vertex farther than this from the zero point is a slip of the pen, not a building."""

OF_A_ROBOT = ("is_charger", "is_cleaning_zone", "spawn_robot_name")
"""What a vertex may say of itself: then its name is that of a robot's place, not of a room."""
NO_NAMES = ("", "null", "none", "~")
"""What stands in the file where nobody gave a door a name."""


@dataclass(frozen=True, slots=True)
class Storey:
    """A level as it stands in the file."""

    name: str
    elevation_m: float
    node: Mapping


@dataclass(frozen=True, slots=True)
class LevelFrame:
    """How a level's drawing, y up, lies in the building: turned and scaled, then shifted."""

    turn: complex = 1.0
    """Turns, and scales to metres."""
    shift: complex = 0.0
    """Metres."""

    def __call__(self, point: complex) -> complex:
        """Return a point of the drawing in metres."""
        return self.turn * point + self.shift


@dataclass(frozen=True, slots=True)
class _Edge:
    """Two vertices joined, with what the file says about that."""

    line: int
    start: Point
    end: Point
    params: Mapping | None

    @property
    def length(self) -> float:
        return math.dist(self.start, self.end)


class StoreyReader:
    """Reads a level. Problems are noted in `problems`; what has one is left out."""

    def __init__(self, number: int, storey: Storey, problems: Problems, *, in_pixels: bool) -> None:
        self.number = number
        self.storey = storey
        self.problems = problems
        self.in_pixels = in_pixels
        self.frame: LevelFrame | None = None
        """How its drawing lies in the building, once that is known; None: nothing has a place."""

    def doors(self) -> list[TableDoor]:
        """Return the level's doors, in the file's order."""
        doors = []
        lines: dict[str, int] = {}
        for edge in self._door_edges:
            name = self._name(edge)
            if name in lines:
                self.problems.add(
                    edge.line,
                    f"door {shown(name)} is on level "
                    f"{shown(self.storey.name)} twice: first on line {lines[name]}; "
                    "rename one of them",
                )
            elif edge.length == 0:
                self.problems.add(
                    edge.line, f"door {shown(name)}: expected two different ends, got one point"
                )
            else:
                if name:
                    lines[name] = edge.line
                doors.append(self._door(name, edge))
        return doors

    @property
    def door_names(self) -> set[str]:
        """The names of the level's own doors."""
        names = (edge.params and edge.params.entries.get("name") for edge in self._door_edges)
        values = (name.items[-1] if isinstance(name, Sequence) and name.items else name
                  for name in names)  # fmt: skip
        return {value.text for value in values if isinstance(value, Scalar)}

    def outlines(self, more_doors: Iterable[Segment] = ()) -> Outlines:
        """Return what the level's floor plan is drawn from, metres, y up.

        Args:
            more_doors: Doors that are not the level's own: those of lifts.
        """
        return Outlines(
            walls=[(edge.start, edge.end) for edge in self._edges("walls")],
            doors=[*((edge.start, edge.end) for edge in self._door_edges), *more_doors],
            floors=self._polygons("floors"),
            holes=self._polygons("holes"),
        )

    def places(self) -> list[TablePlace]:
        """Return the vertices that have a name, but for those that are about one robot's work."""
        found = []
        for node, point in zip(self._list("vertices"), self._vertices, strict=True):
            parts = node.items if isinstance(node, Sequence) else []
            named = parts[3] if len(parts) > 3 else None
            name = named.text.strip() if isinstance(named, Scalar) else ""
            told = parts[4] if len(parts) > 4 else None
            if point is not None and name and not _is_of_a_robot(told):
                found.append(TablePlace(name, self.number, *point))
        return found

    def _name(self, edge: _Edge) -> str:
        """Return what a door is called; empty: nothing, which some editors write as "null"."""
        name = (self._text(edge, "name") or "").strip()
        return "" if name.lower() in NO_NAMES else name

    def _door(self, name: str, edge: _Edge) -> TableDoor:
        (x, y), (end_x, end_y) = edge.start, edge.end
        annotations = {"name": name} if name else {}
        kind = self._text(edge, "type")
        if kind is not None:
            annotations["kind"] = kind
        return TableDoor(
            line=edge.line, door_id=None, level=self.number,
            x=x, y=y, theta=math.atan2(end_y - y, end_x - x), width=edge.length,
            annotations=annotations,
        )  # fmt: skip

    @computed_once
    def _door_edges(self) -> list[_Edge]:
        return self._edges("doors")

    def _text(self, edge: _Edge, key: str) -> str | None:
        """Return a parameter `key: [1, text]`; None where it is missing or empty."""
        node = edge.params.entries.get(key) if edge.params else None
        if isinstance(node, Sequence) and len(node.items) == 2:
            node = node.items[1]
        if node is None or (isinstance(node, Scalar) and node.value in {None, ""}):
            return None
        return yaml_values.text_of(node, f"a door's {key}", self.problems)

    # Metres

    def placed(self, x: float, y: float, line: int, *, what: str = "a vertex") -> Point | None:
        """Return a point of the file in metres, y up; None for one that was refused.

        Args:
            x: As in the file.
            y: As in the file.
            line: Where in the file it is.
            what: What it is, for messages.
        """
        if self.frame is None or math.isnan(x) or math.isnan(y):
            return None
        point = self.frame(complex(x, -y if self.in_pixels else y))
        metres = point.real, point.imag
        if max(map(abs, metres)) > FARTHEST_M:
            self.problems.add(
                line,
                f"expected {what} within 100 km of the zero point, "
                f"got {metres[0]:g}, {metres[1]:g} m",
            )
            return None
        return metres

    @computed_once
    def fiducials(self) -> dict[str, complex]:
        """The level's fiducials by name, as in the file, y up: points of other levels, too.

        A name that is there twice identifies nothing.
        """
        found = []
        for node in self._list("fiducials"):
            parts = yaml_values.sequence_of(node, "a fiducial", self.problems)
            if parts is None or len(parts.items) < 3:
                if parts is not None:
                    self.problems.add(node.line, "expected a fiducial [x, y, name], got fewer")
                continue
            x, y = (
                yaml_values.number_of(part, "a fiducial", self.problems) for part in parts.items[:2]
            )
            name = yaml_values.text_of(parts.items[2], "a fiducial's name", self.problems)
            if x is not None and y is not None and name is not None:
                found.append((name, complex(x, -y)))
        counts = Counter(name for name, _ in found)
        return {name: point for name, point in found if counts[name] == 1}

    @property
    def has_measurements(self) -> bool:
        """Whether somebody measured on the level, well or not."""
        return bool(self._list("measurements"))

    @property
    def has_places(self) -> bool:
        """Whether the level has what needs a place: doors or walls."""
        return bool(self._list("doors") or self._list("walls"))

    @computed_once
    def _vertices(self) -> list[Point | None]:
        """The level's vertices in metres, y up; None for one that was refused."""
        vertices = zip(self._list("vertices"), self._raw_vertices, strict=True)
        return [point and self.placed(*point, node.line) for node, point in vertices]

    @computed_once
    def metres_a_pixel(self) -> float | None:
        """The mean over the level's measurements, as traffic_editor takes it; None: it has none."""
        scales = []
        for node in self._list("measurements"):
            edge = self._edge(node, "a measurement", self._raw_vertices)
            distance_m = self._distance_m(edge) if edge else None
            if edge is None or distance_m is None:
                continue
            if distance_m > 0 and edge.length > 0 and math.isfinite(edge.length):
                scales.append(distance_m / edge.length)
            else:
                self.problems.add(
                    node.line,
                    "a measurement: expected a distance above 0 between "
                    f"two different vertices, got {distance_m:g} m",
                )
        return math.fsum(scales) / len(scales) if scales else None

    def _distance_m(self, edge: _Edge) -> float | None:
        node = edge.params.entries.get("distance") if edge.params else None
        if isinstance(node, Sequence) and len(node.items) == 2:
            node = node.items[1]
        if node is None:
            self.problems.add(edge.line, "a measurement: expected a distance, got none")
            return None
        return yaml_values.number_of(node, "a measurement's distance", self.problems)

    # As in the file

    @computed_once
    def _raw_vertices(self) -> list[Point | None]:
        points: list[Point | None] = []
        for node in self._list("vertices"):
            vertex = yaml_values.sequence_of(node, "a vertex", self.problems)
            if vertex is not None and len(vertex.items) < 2:
                self.problems.add(node.line, "expected a vertex [x, y, …], got fewer values")
            if vertex is None or len(vertex.items) < 2:
                points.append(None)
                continue
            x, y = (
                yaml_values.number_of(part, "a vertex", self.problems) for part in vertex.items[:2]
            )
            points.append(None if x is None or y is None else (x, y))
        return points

    def _edges(self, key: str) -> list[_Edge]:
        found = [self._edge(node, f"one of the {key}", self._vertices) for node in self._list(key)]
        return [edge for edge in found if edge is not None]

    def _edge(self, node: Node, what: str, vertices: list[Point | None]) -> _Edge | None:
        """Return the edge `[start, end, {…}]`; None where it, or one of its vertices, is wrong."""
        parts = yaml_values.sequence_of(node, what, self.problems)
        if parts is None:
            return None
        if len(parts.items) < 2:
            self.problems.add(node.line, f"{what}: expected two vertices, got fewer")
            return None
        start, end = (self._vertex(part, what, vertices) for part in parts.items[:2])
        if start is None or end is None:
            return None
        params = parts.items[2] if len(parts.items) > 2 else None
        return _Edge(node.line, start, end, params if isinstance(params, Mapping) else None)

    def _polygons(self, key: str) -> list[list[Point]]:
        polygons = []
        for node in self._list(key):
            polygon = yaml_values.mapping_of(node, f"one of the {key}", self.problems)
            corners = polygon.entries.get("vertices") if polygon else None
            if isinstance(corners, Sequence):
                found = [self._vertex(part, key, self._vertices) for part in corners.items]
                polygons.append([point for point in found if point is not None])
        return [polygon for polygon in polygons if len(polygon) >= 3]

    def _vertex(self, node: Node, what: str, vertices: list[Point | None]) -> Point | None:
        index = yaml_values.whole_of(node, what, self.problems)
        if index is None:
            return None
        if 0 <= index < len(vertices):
            return vertices[index]
        self.problems.add(
            node.line,
            f"{what}: expected one of the {len(vertices)} vertices of "
            f"level {shown(self.storey.name)}, counted from 0, got {shown(index)}",
        )
        return None

    def _list(self, key: str) -> list[Node]:
        """Return the level's list of that key; empty where there is nothing."""
        node = self.storey.node.entries.get(key)
        if node is None or (isinstance(node, Scalar) and node.value is None):
            return []
        if isinstance(node, Mapping) and not node.entries:  # traffic_editor writes {} for none
            return []
        found = yaml_values.sequence_of(
            node, f"level {shown(self.storey.name)}: {key}", self.problems
        )
        return found.items if found else []


def _is_of_a_robot(params: Node | None) -> bool:
    """Return whether a vertex is a robot's place: it has one of the keys `OF_A_ROBOT`."""
    said = params.entries if isinstance(params, Mapping) else {}
    values = [said[key] for key in OF_A_ROBOT if key in said]
    last = [value.items[-1] if isinstance(value, Sequence) and value.items else value
            for value in values]  # fmt: skip
    return any(
        not (isinstance(value, Scalar) and value.value in {False, None, ""}) for value in last
    )
