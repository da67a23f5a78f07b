"""One level of an Open-RMF building: its vertices, scale, doors, walls and floors."""

from __future__ import annotations

import math
from dataclasses import dataclass

from semmap_log.common.lazily import computed_once
from semmap_log.formats.files.door_table import TableDoor
from semmap_log.formats.files.floor_plan import Outlines, Point
from semmap_log.formats.parsing.problems import Problems, shown
from semmap_log.formats.parsing.strict_yaml import Mapping, Node, Scalar, Sequence
from semmap_log.formats.parsing.yaml_values import (
    mapping_of,
    number_of,
    sequence_of,
    text_of,
    whole_of,
)

FARTHEST_M = 100_000.0
"""A vertex farther than this from the zero point is a slip of the pen, not a building."""


@dataclass(frozen=True, slots=True)
class Storey:
    """A level as it stands in the file."""

    name: str
    elevation_m: float
    node: Mapping


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

    def doors(self) -> list[TableDoor]:
        """Return the level's doors, in the file's order."""
        doors = []
        lines: dict[str, int] = {}
        for edge in self._door_edges:
            name = self._text(edge, "name")
            if name is None:
                self.problems.add(
                    edge.line, "expected a door with a name: give it one in traffic_editor"
                )
            elif name in lines:
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
                lines[name] = edge.line
                doors.append(self._door(name, edge))
        return doors

    def outlines(self) -> Outlines:
        """Return what the level's floor plan is drawn from, metres, y up."""
        return Outlines(
            walls=[(edge.start, edge.end) for edge in self._edges("walls")],
            doors=[(edge.start, edge.end) for edge in self._door_edges],
            floors=self._polygons("floors"),
            holes=self._polygons("holes"),
        )

    def _door(self, name: str, edge: _Edge) -> TableDoor:
        (x, y), (end_x, end_y) = edge.start, edge.end
        annotations = {"name": name}
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
        if node is None or (isinstance(node, Scalar) and node.text == ""):
            return None
        return text_of(node, f"a door's {key}", self.problems)

    # Metres

    @computed_once
    def _vertices(self) -> list[Point | None]:
        """The level's vertices in metres, y up; None for one that was refused."""
        scale = self._metres_a_pixel if self.in_pixels else 1.0
        flip = -1.0 if self.in_pixels else 1.0
        placed: list[Point | None] = []
        for node, point in zip(self._list("vertices"), self._raw_vertices, strict=True):
            metres = (
                None
                if point is None or scale is None
                else (point[0] * scale, flip * point[1] * scale)
            )
            if metres and max(map(abs, metres)) > FARTHEST_M:
                self.problems.add(
                    node.line,
                    "expected a vertex within 100 km of the zero point, "
                    f"got {metres[0]:g}, {metres[1]:g} m",
                )
                metres = None
            placed.append(metres)
        return placed

    @computed_once
    def _metres_a_pixel(self) -> float | None:
        """The mean over the level's measurements, as traffic_editor takes it."""
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
        if scales:
            return math.fsum(scales) / len(scales)
        if not self._list("measurements") and (self._list("doors") or self._list("walls")):
            self.problems.add(
                self.storey.node.line,
                f"level {shown(self.storey.name)}: expected a measurement, which gives the metres "
                "of a pixel, got none; add one in traffic_editor",
            )
        return None

    def _distance_m(self, edge: _Edge) -> float | None:
        node = edge.params.entries.get("distance") if edge.params else None
        if isinstance(node, Sequence) and len(node.items) == 2:
            node = node.items[1]
        if node is None:
            self.problems.add(edge.line, "a measurement: expected a distance, got none")
            return None
        return number_of(node, "a measurement's distance", self.problems)

    # As in the file

    @computed_once
    def _raw_vertices(self) -> list[Point | None]:
        points: list[Point | None] = []
        for node in self._list("vertices"):
            vertex = sequence_of(node, "a vertex", self.problems)
            if vertex is not None and len(vertex.items) < 2:
                self.problems.add(node.line, "expected a vertex [x, y, …], got fewer values")
            if vertex is None or len(vertex.items) < 2:
                points.append(None)
                continue
            x, y = (number_of(part, "a vertex", self.problems) for part in vertex.items[:2])
            points.append(None if x is None or y is None else (x, y))
        return points

    def _edges(self, key: str) -> list[_Edge]:
        found = [self._edge(node, f"one of the {key}", self._vertices) for node in self._list(key)]
        return [edge for edge in found if edge is not None]

    def _edge(self, node: Node, what: str, vertices: list[Point | None]) -> _Edge | None:
        """Return the edge `[start, end, {…}]`; None where it, or one of its vertices, is wrong."""
        parts = sequence_of(node, what, self.problems)
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
            polygon = mapping_of(node, f"one of the {key}", self.problems)
            corners = polygon.entries.get("vertices") if polygon else None
            if isinstance(corners, Sequence):
                found = [self._vertex(part, key, self._vertices) for part in corners.items]
                polygons.append([point for point in found if point is not None])
        return [polygon for polygon in polygons if len(polygon) >= 3]

    def _vertex(self, node: Node, what: str, vertices: list[Point | None]) -> Point | None:
        index = whole_of(node, what, self.problems)
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
        found = sequence_of(node, f"level {shown(self.storey.name)}: {key}", self.problems)
        return found.items if found else []
