"""The levels, each with its floor plan as a picture of ink: the page gives it its colours."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semmap_log.core.model.doors import DoorMap
from semmap_log.core.model.events import FloorMap
from semmap_log.views.bounds import UNKNOWN_CELL, Bounds, bounds_of_floor, rooms_shown
from semmap_log.views.excerpt.span import NO_PLANS, PlanEra, doors_at_ends, level_plans
from semmap_log.views.report.page_events import PageDoor, Rows
from semmap_log.views.report.page_rooms import rooms_of_page
from semmap_log.views.zone_times import MS_NS, Span

if TYPE_CHECKING:
    from semmap_log.views.excerpt.span import Excerpt

MOST_CELLS = 2000
"""Along a side of the picture; of a finer map several cells become one, the darkest of them."""
FLOOR_INK, WALL_INK = 14, 190
"""Of 255: how much of a free cell, and of an occupied one, is covered. Unknown is left out."""
OCCUPIED = 100


@dataclass(frozen=True, slots=True)
class PageContent:
    """The content of a page on its levels."""

    told: Sequence[PageDoor]
    """Its doors."""
    poses: Rows
    """Where the robot was."""
    span: Span


def shown_levels(
    excerpt: Excerpt, now: DoorMap, content: PageContent, home: int | None
) -> list[dict[str, Any]]:
    """Return the levels with something on them, numbers ascending; at least one.

    A level that was mapped again has its last plan, valid from `since`; `earlier` holds the others.

    Args:
        excerpt: The part of the log.
        now: The map at its end.
        content: The content of the page.
        home: The level on which level 0 is shown, its content already moved there; None: nowhere.
    """
    used = {int(n) for door in content.told for n in np.unique(door.picture.placements["level"])}
    used |= set(np.unique(content.poses["level"]).tolist())
    if excerpt.doors is None:
        used |= {n for n, level in now.levels.items() if level.floor_map_event is not None}
    if home is None:
        used.discard(0)
    rooms = rooms_shown(excerpt.log, now)
    plans = level_plans(excerpt, used)
    shown = []
    for number in sorted(used) or [0]:
        eras = plans.get(number, NO_PLANS).happened
        if len(eras) > 1:
            shown.append(_remapped(number, excerpt, now, content, eras))
            continue
        floor = excerpt.log.floor_of(now, number)
        bounds = _bounds(number, content, ALL_TIME)
        shown.append(_level(number, now, floor, bounds) | {"rooms": rooms_of_page(rooms, number)})
    return shown


def begins_of_plans(levels: Iterable[Mapping[str, Any]], span: Span) -> dict[int, list[int]]:
    """Return, for each level that was mapped again, when each later plan begins, ns."""
    return {
        level["level"]: [
            (plan["since"] + span.begin_ms) * MS_NS for plan in [*level["earlier"][1:], level]
        ]
        for level in levels
        if "earlier" in level
    }


ALL_TIME = (-(2**63), 2**63 - 1)
"""First and last nanosecond."""


def _remapped(
    number: int, excerpt: Excerpt, now: DoorMap, content: PageContent, eras: Sequence[PlanEra]
) -> dict[str, Any]:
    begins = [ALL_TIME[0], *(int(era.since["folds_ns"][0]) for era in eras[1:])]
    ends = [*(begin - 1 for begin in begins[1:]), ALL_TIME[1]]
    plans = []
    for (era, doors), begin, end in zip(doors_at_ends(eras, excerpt), begins, ends, strict=True):
        bounds = _bounds(number, content, (begin, end))
        rooms = rooms_of_page(rooms_shown(excerpt.log, doors), number)
        since = content.span.since_begin(max(begin, 0))
        plans.append(_level(number, now, era.floor, bounds) | {"rooms": rooms, "since": since})
    return plans[-1] | {"earlier": plans[:-1]}


def _level(number: int, now: DoorMap, floor: FloorMap | None, bounds: Bounds) -> dict[str, Any]:
    picture = None if floor is None else picture_of(floor)
    if floor is not None:
        bounds = bounds.including(bounds_of_floor(floor))
    framed = bounds.framed()
    known = now.levels.get(number)
    return {
        "level": number,
        "name": (known.name if known else None) or f"Level {number}",
        "bounds": [round(value, 3) for value in (framed.low_x, framed.low_y,
                                                 framed.high_x, framed.high_y)],
        "isEmpty": bounds.is_empty,
        "floor": picture,
    }  # fmt: skip


def _bounds(number: int, content: PageContent, time: tuple[int, int]) -> Bounds:
    """Return the bounds of a level's doors and robots in a time, its ends included."""
    poses = _during(content.poses, time)
    here = poses[poses["level"] == number]
    bounds = Bounds().around(here["x"], here["y"])
    for page_door in content.told:
        placements = page_door.picture.placements
        held = max(int(np.searchsorted(placements["folds_ns"], time[0], "right")) - 1, 0)
        places = _during(placements[held:], (ALL_TIME[0], time[1]))
        with np.errstate(over="ignore", invalid="ignore"):
            ends = page_door.shape.strips(places[places["level"] == number]).reshape(-1, 2)
        bounds = bounds.around(ends[:, 0], ends[:, 1])
    return bounds


def _during(rows: Rows, time: tuple[int, int]) -> Rows:
    during: Rows = rows[(rows["folds_ns"] >= time[0]) & (rows["folds_ns"] <= time[1])]
    return during


def picture_of(floor: FloorMap) -> Mapping[str, Any] | None:
    """Return a floor plan as a PNG's data URI and its place; None: no cell is known.

    `matrix` takes the picture's (right, down) in units of its cells to (x, -y) in metres: SVG's
    six numbers.
    """
    rows, columns = np.nonzero(floor.cells != UNKNOWN_CELL)
    if not len(rows):
        return None
    low, left = int(rows.min()), int(columns.min())
    cells = floor.cells[low : int(rows.max()) + 1, left : int(columns.max()) + 1]
    coarse = math.ceil(max(cells.shape) / MOST_CELLS)
    cells = _coarser(cells, coarse)
    side = floor.resolution * coarse
    return {
        "src": _data_uri(np.flipud(cells)),
        "width": cells.shape[1],
        "height": cells.shape[0],
        "matrix": _matrix(floor, left, low, side, cells.shape[0]),
    }


def _coarser(cells: NDArray[np.int8], by: int) -> NDArray[np.int8]:
    """Return blocks of cells as one: occupied where one of them is, known where one is."""
    if by == 1:
        return cells
    high, wide = (-(-side // by) * by for side in cells.shape)
    padded = np.full((high, wide), UNKNOWN_CELL, np.int8)
    padded[: cells.shape[0], : cells.shape[1]] = cells
    blocks: NDArray[np.int8] = padded.reshape(high // by, by, wide // by, by).max((1, 3))
    return blocks


def _data_uri(cells: NDArray[np.int8]) -> str:
    """Return black ink on nothing, row 0 on top."""
    indices = np.where(cells == UNKNOWN_CELL, OCCUPIED + 1, cells).astype(np.uint8)
    share = np.linspace(0.0, 1.0, OCCUPIED + 1)
    ink = np.rint(FLOOR_INK + share * (WALL_INK - FLOOR_INK)).astype(np.uint8)
    picture = Image.fromarray(np.ascontiguousarray(indices), "P")
    picture.putpalette(bytes(3 * (OCCUPIED + 2)))
    png = io.BytesIO()
    picture.save(png, "PNG", optimize=True, transparency=bytes([*ink.tolist(), 0]))
    return "data:image/png;base64," + base64.b64encode(png.getvalue()).decode()


def _matrix(floor: FloorMap, left: int, low: int, side: float, rows: int) -> list[float]:
    cos, sin = math.cos(floor.origin_theta), math.sin(floor.origin_theta)
    # The upper left corner of the picture, along the map's own axes.
    u, v = left * floor.resolution, low * floor.resolution + rows * side
    x = floor.origin_x + cos * u - sin * v
    y = floor.origin_y + sin * u + cos * v
    return [round(value, 9) for value in (cos * side, -sin * side, sin * side, cos * side, x, -y)]
