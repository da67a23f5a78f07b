"""What stands still in a house: walls with their thickness, door frames, glass, furniture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from patrol_sim.laser_doors import SLIDES, DoorBody
from patrol_sim.laser_plan import LevelPlan
from patrol_sim.laser_surfaces import Floats, Lines, Surface, bar, box, joined
from semmap_log.core.model.events import FloorMap

FRAME_M = 0.06
"""How wide a jamb is; by `JUTS_M` it stands into the opening, and out of the wall."""
JUTS_M = 0.005
ON_WALL_M = 0.35
PARALLEL = math.cos(math.radians(15))
KEEP_FREE_M = 0.55
"""Furniture stays this far from where the robot's laser goes."""
POST_M, PANE_M = 0.05, 1.2
"""A glass wall has posts of that width, so far apart."""

FURNITURE = (
    ("cabinet", 0.30), ("desk", 0.25), ("table", 0.15), ("chair", 0.2), ("pillar", 0.03),
    ("bin", 0.07),
)  # fmt: skip
"""What there is, and how much of it."""


@dataclass(frozen=True, slots=True)
class Wall:
    """A straight piece of wall between doors and corners."""

    start: Floats
    end: Floats
    glass: bool = False


def walls_of(
    plan: LevelPlan, doors: Sequence[DoorBody], *, wall_m: float, glass_share: float,
    rng: np.random.Generator,
) -> list[Wall]:  # fmt: skip
    """Return the pieces of wall that the doors leave; some are of glass."""
    pieces = []
    for row in plan.walls:
        start, end = row[:2], row[2:]
        for a, b in _without_doors(start, end, doors, wall_m):
            length = float(np.hypot(*(b - a)))
            glass = length > 1.5 and rng.random() < glass_share
            pieces.append(Wall(a, b, bool(glass)))
    return pieces


def lines_of(walls: Sequence[Wall], doors: Sequence[DoorBody], *, wall_m: float) -> Lines:
    """Return the outlines of the walls and of all door frames."""
    parts = []
    for wall in walls:
        if wall.glass:
            parts += _glass_wall(wall)
        else:
            half = wall_m / 2
            parts.append(
                bar(wall.start, wall.end, left_m=half, right_m=half, surface=Surface.PAINT)
            )
    for door in doors:
        parts += _frame(door, wall_m)
    return joined(parts)


def furniture(
    plan: LevelPlan, walls: Sequence[Wall], doors: Sequence[DoorBody], track: Floats, *,
    pieces: int, rng: np.random.Generator,
) -> Lines:  # fmt: skip
    """Return furniture: along walls and in the rooms, clear of doors and of the robot's way."""
    free = FreeFloor(plan.floor)
    swings = [(np.mean(door.ends, axis=0), door.drawn.width + 0.45) for door in doors]
    names = [name for name, _ in FURNITURE]
    shares = np.array([share for _, share in FURNITURE])
    placed: list[Lines] = []
    for _ in range(pieces * 6):
        if len(placed) == pieces:
            break
        made = _piece(str(rng.choice(names, p=shares / shares.sum())), walls, free, rng)
        if made is None:
            continue
        lines, points = made
        reach = float(np.hypot(*(points - points.mean(axis=0)).T).max())
        middle = points.mean(axis=0)
        in_way = np.hypot(*(track - middle).T).min() < reach + KEEP_FREE_M
        in_swing = any(np.hypot(*(middle - at)) < reach + far for at, far in swings)
        if not in_way and not in_swing and free.holds(points):
            placed.append(lines)
    return joined(placed)


class FreeFloor:
    """Where there is floor and no wall."""

    def __init__(self, floor: FloorMap) -> None:
        self._cells = np.asarray(floor.cells) == 0
        self._origin = np.array([floor.origin_x, floor.origin_y])
        self._cell_m = floor.resolution
        self._free = np.argwhere(self._cells)

    def holds(self, points: Floats) -> bool:
        """Tell whether all these points lie on it."""
        columns, rows = ((points - self._origin) // self._cell_m).astype(int).T
        inside = (rows >= 0) & (columns >= 0)
        inside &= (rows < self._cells.shape[0]) & (columns < self._cells.shape[1])
        return bool(inside.all() and self._cells[rows, columns].all())

    def some(self, rng: np.random.Generator) -> Floats:
        """Return a point on it."""
        row, column = self._free[rng.integers(len(self._free))]
        point: Floats = self._origin + (np.array([column, row]) + rng.random(2)) * self._cell_m
        return point

    def reach(self, start: Floats, direction: Floats, most_m: float = 6.0) -> float:
        """Return how far it goes on in a direction, m."""
        steps = np.arange(0.2, most_m, 0.1)
        for step in steps:
            if not self.holds((start + step * direction)[None]):
                return float(step)
        return most_m


def _without_doors(
    start: Floats, end: Floats, doors: Sequence[DoorBody], wall_m: float
) -> list[tuple[Floats, Floats]]:
    """Return what the doors on a wall leave of it; free ends are longer by half its thickness."""
    length = float(np.hypot(*(end - start)))
    if length < 1e-6:
        return []
    along = (end - start) / length
    left = np.array([-along[1], along[0]])
    cuts = []
    low_m, high_m = -wall_m / 2, length + wall_m / 2
    for door in doors:
        a, b = (point - start for point in door.ends)
        if abs((b - a) @ along) < PARALLEL * np.hypot(*(b - a)):
            continue
        if max(abs(a @ left), abs(b @ left)) > ON_WALL_M:
            continue
        first, last = sorted((float(a @ along), float(b @ along)))
        if last > low_m and first < high_m:
            cuts.append((first, last))
    pieces, at_m = [], low_m
    for first, last in [*sorted(cuts), (high_m, high_m)]:
        if first - at_m > 0.03:
            pieces.append((start + at_m * along, start + min(first, high_m) * along))
        at_m = max(at_m, last)
    return pieces


def _frame(door: DoorBody, wall_m: float) -> list[Lines]:
    """Return both jambs: they fill what the wall leaves, and stand a little into the opening."""
    if door.kind in SLIDES:  # the leaf goes through where a jamb would be
        return []
    start, end = door.ends
    inward, deep = door.drawn.along, wall_m / 2 + JUTS_M
    return [
        bar(at - FRAME_M * to, at + JUTS_M * to, left_m=deep, right_m=deep, surface=Surface.WOOD)
        for at, to in ((start, inward), (end, -inward))
    ]


def _glass_wall(wall: Wall) -> list[Lines]:
    """Return panes, and the posts between them."""
    length = float(np.hypot(*(wall.end - wall.start)))
    along = (wall.end - wall.start) / length
    pane = Lines(np.array([[*wall.start, *wall.end]]), np.array([Surface.GLASS], np.int8))
    posts = np.linspace(0, length, max(2, round(length / PANE_M) + 1))
    turn = math.atan2(along[1], along[0])
    return [
        pane,
        *(box(wall.start + at * along, (POST_M, POST_M), turn, Surface.SHINY) for at in posts),
    ]


def _piece(
    what: str, walls: Sequence[Wall], free: FreeFloor, rng: np.random.Generator
) -> tuple[Lines, Floats] | None:
    """Return a piece of furniture as lines, and points that have to be on free floor."""
    if what in {"cabinet", "desk"}:
        return _at_wall(what, walls, rng)
    at, turn = free.some(rng), rng.uniform(0, math.pi)
    if what == "pillar":
        return _boxed(at, (0.4, 0.4), 0.0, Surface.PAINT)
    if what == "bin":
        return _boxed(at, (0.3, 0.3), turn, Surface.DARK)
    size = (rng.uniform(0.8, 1.6), rng.uniform(0.6, 0.9)) if what == "table" else (0.45, 0.42)
    # At the laser's height a table or a chair is four legs.
    corners = box(at, size, turn, Surface.DARK).ends[:, :2]
    legs = [box(corner, (0.04, 0.04), turn, Surface.SHINY) for corner in corners]
    return joined(legs), corners


def _at_wall(
    what: str, walls: Sequence[Wall], rng: np.random.Generator
) -> tuple[Lines, Floats] | None:
    wall = walls[rng.integers(len(walls))]
    length = float(np.hypot(*(wall.end - wall.start)))
    wide = rng.uniform(0.6, 1.6)
    if length < wide + 0.3:
        return None
    along = (wall.end - wall.start) / length
    deep = rng.uniform(0.35, 0.6) if what == "cabinet" else rng.uniform(0.6, 0.8)
    aside = np.array([-along[1], along[0]]) * rng.choice([-1, 1])
    at = wall.start + rng.uniform(wide / 2, length - wide / 2) * along
    at = at + (0.12 + deep / 2 + rng.uniform(0, 0.05)) * aside
    surface = Surface(rng.choice([Surface.WOOD, Surface.PAINT, Surface.DARK, Surface.SHINY]))
    return _boxed(at, (wide, deep), math.atan2(along[1], along[0]), surface)


def _boxed(
    at: Floats, size: tuple[float, float], turn: float, surface: Surface
) -> tuple[Lines, Floats]:
    lines = box(at, size, turn, surface)
    return lines, lines.ends[:, :2]
