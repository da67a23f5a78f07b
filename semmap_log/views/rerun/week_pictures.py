"""Typical weeks in a rerun recording: a picture a level, with 7 rows of 24 cells for each door.

The cells hold P(open) in percent, so that hovering over one shows it. Hours stand below each
column of doors, days at the left where there is room for them, the colours' key at the right.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.beliefs.door_beliefs import TypicalWeek
from semmap_log.analysis.probabilities.evidence.coverage import DAY_NAMES, DAYS, HOURS
from semmap_log.views.palette import WEEK_AXES, WEEK_UNKNOWN, WHITE, Rgb, shade
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.scene import EntityPath, RowWriter, Scene, SceneLevel, rgba

WEEKS = "weeks"

UNKNOWN_CELL, NO_CELL = 101, 102
"""Values of cells without a percentage of 0 to 100."""

ASPECT = 3.3
"""Width of the doors' part of the view over its height."""
LABELS_ACROSS = 45
"""Width of the view in heights of a label: labels do not grow with the view."""
LABELS_DOWN = 9
"""Height of all weeks in heights of a label, where they fill the view from top to bottom."""
MOST_NAMES = 12
"""Up to so many weeks have their door's name above them. Of more, the name stands at the side
where the longest has room, else the id."""
LETTER = 0.45
"""Width of a letter, in heights of a label."""
TALLEST_LABEL = 8.5
"""At the side of a week, in cells. A taller label would reach into those above and below."""


@dataclass(frozen=True, slots=True)
class Tile:
    """The space that a door takes, in cells: its week at the lower right, its label next to it."""

    width: int
    height: int
    label: tuple[float, float]
    """From the week's upper left corner, if there are many; the viewer writes below that point."""
    hours: tuple[int, ...]
    """Those that are written."""
    days: tuple[int, ...]

    @property
    def corner(self) -> tuple[int, int]:
        """Column and row of the week's upper left corner."""
        return self.width - HOURS, self.height - DAYS


NAMED = Tile(HOURS + 3, DAYS + 4, (HOURS / 2, -3.2), (0, 6, 12, 18, 24), (0, 3, 6))
NUMBERED = Tile(HOURS + 14, DAYS + 2, (-6.0, 0.0), (0, 12, 24), ())


@dataclass(frozen=True, slots=True)
class Sheet:
    """How the tiles of a level are arranged, and what is around them; in cells."""

    tile: Tile
    doors: int
    columns: int

    @classmethod
    def of(cls, doors: int, letters: int) -> Sheet:
        """Return the sheet for a number of doors, by the letters of their longest name."""
        if doors > MOST_NAMES and (named := _named_at_side(doors, letters)) is not None:
            return named
        tile = NAMED if doors <= MOST_NAMES else NUMBERED
        columns = math.ceil(math.sqrt(doors * ASPECT * tile.height / tile.width))
        return cls(tile, doors, min(columns, doors))

    @property
    def has_names(self) -> bool:
        """Return whether there is room for the doors' names."""
        return self.tile is not NUMBERED

    @property
    def rows(self) -> int:
        """Rows of tiles."""
        return math.ceil(self.doors / self.columns)

    @property
    def line(self) -> float:
        """Height of a label, whether the view's width or, of few doors, its height is filled."""
        across = self.columns * self.tile.width / (LABELS_ACROSS - 8)
        return max(across, self.rows * self.tile.height / LABELS_DOWN)

    @property
    def left(self) -> int:
        """What is free at the left, for days."""
        return math.ceil(2 * self.line)

    @property
    def right(self) -> int:
        """Where the key begins."""
        return self.left + self.columns * self.tile.width + math.ceil(0.7 * self.line)

    @property
    def bar(self) -> int:
        """Width of the key's colours."""
        return math.ceil(0.8 * self.line)

    @property
    def width(self) -> int:
        """Of all, the key and its words included."""
        return self.right + math.ceil(5 * self.line)

    @property
    def height(self) -> int:
        """Of all."""
        return self.rows * self.tile.height + math.ceil(1.4 * self.line)

    def corner(self, place: int) -> tuple[int, int]:
        """Return column and row of the upper left corner of a door's week."""
        row, column = divmod(place, self.columns)
        return (
            self.left + column * self.tile.width + self.tile.corner[0],
            row * self.tile.height + self.tile.corner[1],
        )


def _named_at_side(doors: int, letters: int) -> Sheet | None:
    """Return the sheet with the largest cells that has names at the side; None: no room."""
    sheets = (_next_to(doors, columns, letters) for columns in range(1, doors + 1))
    fitting = [sheet for sheet in sheets if sheet is not None and sheet.line <= TALLEST_LABEL]
    return min(fitting, key=lambda sheet: sheet.line, default=None)


def _next_to(doors: int, columns: int, letters: int) -> Sheet | None:
    """Return a sheet of so many columns, each with room for names; None: these take all of it.

    The taller a label, the wider its tile; the wider the tiles, the taller a label.
    """
    label = LETTER * letters + 1  # in heights of a label, its frame included
    across = LABELS_ACROSS - 8 - columns * label
    if across <= 0:
        return None
    height = NUMBERED.height
    line = max(columns * (HOURS + 2) / across, math.ceil(doors / columns) * height / LABELS_DOWN)
    room = math.ceil(label * line)
    place = (-room / 2 - 1, DAYS / 2 - line / 2)
    return Sheet(Tile(HOURS + 2 + room, height, place, NUMBERED.hours, ()), doors, columns)


Label = tuple[str, float, float]
"""What is written, centred below a point."""


def weeks_path(level: SceneLevel) -> EntityPath:
    """Return the entity of a level's weeks; outside of its plan, where they would be drawn, too."""
    return (WEEKS, *level.path[1:])


def write_weeks(writer: RowWriter, weeks: Sequence[TypicalWeek], scene: Scene) -> None:
    """Write the picture of each level, and its doors' labels."""
    for level in scene.levels.values():
        here = weeks_on(weeks, scene, level)
        if not here:
            continue
        path, sheet = weeks_path(level), sheet_of(here, scene)
        writer.static(path, _context(), rr.SegmentationImage(picture(here, sheet), opacity=1.0))
        doors = [scene.doors[week.door.door_id] for week in here]
        names = [d.short_label if sheet.has_names else str(d.door_id) for d in doors]
        _write_labels(writer, (*path, "labels"), door_labels(names, sheet), WHITE)
        _write_labels(writer, (*path, "axes"), axis_labels(sheet), WEEK_AXES)


def weeks_on(weeks: Sequence[TypicalWeek], scene: Scene, level: SceneLevel) -> list[TypicalWeek]:
    """Return the weeks of the doors whose lanes are on a level."""
    return [week for week in weeks if scene.doors[week.door.door_id].path[:-2] == level.path]


def sheet_of(weeks: Sequence[TypicalWeek], scene: Scene) -> Sheet:
    """Return how the weeks of a level are arranged."""
    names = [scene.doors[week.door.door_id].short_label for week in weeks]
    return Sheet.of(len(names), max(map(len, names), default=0))


def picture(weeks: Sequence[TypicalWeek], sheet: Sheet) -> NDArray[np.uint8]:
    """Return the cells: door by door from left to right, row by row; and the key.

    A door has Monday on top and midnight at the left; the key has 1 on top, and unknown at the
    bottom.
    """
    cells = np.full((sheet.height, sheet.width), NO_CELL, np.uint8)
    for place, week in enumerate(weeks):
        left, top = sheet.corner(place)
        cells[top : top + DAYS, left : left + HOURS] = _cells(week)
    bar = slice(sheet.right, sheet.right + sheet.bar)
    top, bottom, below = _key(sheet)
    cells[top:bottom, bar] = np.rint(np.linspace(100, 0, bottom - top))[:, None]
    cells[below:, bar] = UNKNOWN_CELL
    return cells


def door_labels(names: Sequence[str], sheet: Sheet) -> Iterator[Label]:
    """Yield the doors' labels, and their places."""
    for place, name in enumerate(names):
        left, top = sheet.corner(place)
        right, down = sheet.tile.label
        yield name, left + right, top + max(down, -1.4 * sheet.line)


def axis_labels(sheet: Sheet) -> Iterator[Label]:
    """Yield hours, days and the words of the key."""
    for place in range(sheet.doors):
        left, top = sheet.corner(place)
        if place + sheet.columns >= sheet.doors:
            for hour in sheet.tile.hours:
                yield str(hour), left + hour, top + DAYS + 0.1 * sheet.line
        if place % sheet.columns == 0:
            for day in sheet.tile.days:
                yield DAY_NAMES[day], left - 1.2 * sheet.line, top + day + 0.5 - sheet.line / 2
    top, bottom, below = _key(sheet)
    beside = sheet.right + sheet.bar + 0.8 * sheet.line
    yield "1", beside, top
    yield "P(open)", beside + sheet.line, (top + bottom - sheet.line) / 2
    yield "0", beside, bottom - sheet.line
    yield "unknown", beside + 1.1 * sheet.line, below - 0.2 * sheet.line


def _key(sheet: Sheet) -> tuple[int, int, int]:
    """Return where the bar of colours begins and ends, and where the sample of no colour begins."""
    below = sheet.height - max(math.ceil(0.8 * sheet.line), 1)
    top = sheet.tile.corner[1]
    return top, max(below - math.ceil(0.5 * sheet.line), top + 1), below


def _cells(week: TypicalWeek) -> NDArray[np.uint8]:
    percent = np.rint(100 * week.hours.p_open).astype(np.uint8)
    return np.where(week.hours.is_known, percent, np.uint8(UNKNOWN_CELL))


def _write_labels(
    writer: RowWriter, path: EntityPath, labels: Iterator[Label], colour: Rgb
) -> None:
    words, x, y = zip(*labels, strict=True)
    writer.static(
        path,
        rr.Points2D(np.column_stack([x, y]), labels=words, radii=rr.Radius.ui_points(0.0),
                    colors=rgba([colour]), show_labels=True, draw_order=10.0),
    )  # fmt: skip


def _context() -> Any:
    """Return the context that gives each cell its colour and words; other places are not drawn."""
    cells = [
        rr.AnnotationInfo(id=percent, label=f"P(open) {percent} %", color=shade(percent / 100))
        for percent in range(101)
    ]
    unknown = rr.AnnotationInfo(
        id=UNKNOWN_CELL, label="never seen then, or too little", color=WEEK_UNKNOWN
    )
    nothing = rr.AnnotationInfo(id=NO_CELL, label="", color=(0, 0, 0, 0))
    return rr.AnnotationContext([*cells, unknown, nothing])
