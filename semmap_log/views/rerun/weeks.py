"""Typical weeks into a rerun recording: a picture a level, 7 rows of 24 cells a door.

The cells hold P(open) in percent, so that hovering over one tells it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.beliefs.typical_week import TypicalWeek
from semmap_log.probabilities.evidence.coverage import DAYS, HOURS
from semmap_log.views.palette import Rgb
from semmap_log.views.rerun.rows import RowWriter
from semmap_log.views.rerun.scene import EntityPath, Scene, SceneLevel
from semmap_log.views.rerun.sdk import rr
from semmap_log.views.week_shades import shade

WEEKS = "weeks"

NEVER_SEEN, NO_CELL = 101, 102
"""Beside 0..100, percent."""
NEVER_SEEN_RGB: Rgb = (70, 74, 82)

ASPECT = 4.0
"""Width of the view over its height."""
MOST_NAMES = 12
"""With more doors their names would lie on each other: there, ids stand for them."""


@dataclass(frozen=True, slots=True)
class Tile:
    """The room that a door takes, in cells: its week at the lower right, its label beside."""

    width: int
    height: int
    label: tuple[float, float]
    """From the week's upper left corner; the viewer writes below that point."""

    @property
    def corner(self) -> tuple[int, int]:
        """Column and row of the week's upper left corner."""
        return self.width - HOURS, self.height - DAYS


NAMED = Tile(width=HOURS + 3, height=DAYS + 4, label=(HOURS / 2, -1.2))
NUMBERED = Tile(width=HOURS + 14, height=DAYS + 2, label=(-6.0, 0.0))


def weeks_path(level: SceneLevel) -> EntityPath:
    """Return the entity of a level's weeks; outside of its plan, where they would be drawn, too."""
    return (WEEKS, *level.path[1:])


def write_weeks(writer: RowWriter, weeks: Sequence[TypicalWeek], scene: Scene) -> None:
    """Write the picture of each level, and what its doors are called."""
    for level in scene.levels.values():
        here = weeks_on(weeks, scene, level)
        if not here:
            continue
        path = weeks_path(level)
        tile = NAMED if len(here) <= MOST_NAMES else NUMBERED
        picture, places = tiles(here, tile)
        writer.static(path, _context(), rr.SegmentationImage(picture, opacity=1.0))
        doors = [scene.doors[week.door.door_id] for week in here]
        labels = [d.short_label if tile is NAMED else str(d.door_id) for d in doors]
        writer.static(
            (*path, "labels"),
            rr.Points2D(places, labels=labels, radii=rr.Radius.ui_points(0.0),
                        colors=[0xFFFFFFFF], show_labels=True, draw_order=10.0),
        )  # fmt: skip


def weeks_on(weeks: Sequence[TypicalWeek], scene: Scene, level: SceneLevel) -> list[TypicalWeek]:
    """Return the weeks of the doors whose lanes are on a level."""
    return [week for week in weeks if scene.doors[week.door.door_id].path[:-2] == level.path]


def tiles(
    weeks: Sequence[TypicalWeek], tile: Tile
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Return the picture, and where in it each door's label stands, (n, x and y).

    Door by door from left to right, row by row; Monday on top, midnight at the left.
    """
    columns = math.ceil(math.sqrt(len(weeks) * ASPECT * tile.height / tile.width))
    columns = min(columns, len(weeks))
    rows = math.ceil(len(weeks) / columns)
    picture = np.full((rows * tile.height, columns * tile.width), NO_CELL, np.uint8)
    places = np.empty((len(weeks), 2))
    for i, week in enumerate(weeks):
        left = i % columns * tile.width + tile.corner[0]
        top = i // columns * tile.height + tile.corner[1]
        picture[top : top + DAYS, left : left + HOURS] = _cells(week)
        places[i] = left + tile.label[0], top + tile.label[1]
    return picture, places


def _cells(week: TypicalWeek) -> NDArray[np.uint8]:
    percent = np.rint(100 * week.hours.p_open).astype(np.uint8)
    return np.where(week.hours.is_known, percent, np.uint8(NEVER_SEEN))


def _context() -> Any:
    """Return what gives each cell its colour and its words; what is no cell is not drawn."""
    cells = [
        rr.AnnotationInfo(id=percent, label=f"P(open) {percent} %", color=shade(percent / 100))
        for percent in range(101)
    ]
    never = rr.AnnotationInfo(id=NEVER_SEEN, label="never seen", color=NEVER_SEEN_RGB)
    nothing = rr.AnnotationInfo(id=NO_CELL, label="", color=(0, 0, 0, 0))
    return rr.AnnotationContext([*cells, never, nothing])
