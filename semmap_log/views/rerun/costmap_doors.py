"""Which cells of the costmap's door layer each door shows, and from when. Pure numpy.

Of several doors on a cell the one with the greatest id has it, whatever its state (an unknown one
erases): so a door shows the cells of its line that no door with a greater id lies on. That changes
when it, or another door there, is moved. An object that is not a line, such as an area, lies above
all lines: it shows all of its cells where it blocks, and none where it does not.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import NO_INFORMATION, cells_of
from semmap_log.analysis.costmap_2d.grid import MOST_CELLS, CellWindow, GridGeometry
from semmap_log.core.folds.door_changes import CHANGE, Changes
from semmap_log.core.model.doors import DoorId
from semmap_log.views.excerpt.door_rows import AS_A_DOOR, DoorPicture, ObjectShape

RESOLUTION_M = 0.05
"""Of a level without a floor map: that of `CostmapOptions`."""

MOST_PATCH_CELLS = 2**18
"""A door of 25 m, drawn across; a longer one would fill the recording, and shows its line alone."""


@dataclass(frozen=True, slots=True)
class Patch:
    """The cells that a door shows."""

    window: CellWindow
    shown: bytes
    """bool, rows of the window one after the other."""

    def costs(self, cost: int) -> NDArray[np.uint8]:
        """Return the window of the layer, (rows, columns), as far as it is this door's."""
        shown = np.frombuffer(self.shown, np.bool_).reshape(self.window.shape)
        costs: NDArray[np.uint8] = np.where(shown, np.uint8(cost), np.uint8(NO_INFORMATION))
        return costs


Cells = NDArray[np.int64]
Stamp = Changes
"""One row."""
Version: TypeAlias = tuple[Stamp, Patch | None]
"""Which cells a door shows, and from when on; None: it shows nothing."""


def versions_of(
    doors: Mapping[DoorId, DoorRows], level: int, geometry: GridGeometry, order: Order
) -> dict[DoorId, list[Version]]:
    """Return the cells that each door of a level shows over time.

    Args:
        doors: Id -> its rows.
        level: The level.
        geometry: Of its layer.
        order: In which placements count.
    """
    versions: dict[DoorId, list[Version]] = {}
    last: dict[DoorId, _Move] = {}
    doors_at: dict[int, list[DoorId]] = {}
    for move in _moves(doors, level, geometry, order):
        if not doors[move.door].shape.is_line:
            patch = _patch(move, move.cells.tolist())
            versions.setdefault(move.door, []).append((move.stamp, patch))
            continue
        before = last[move.door].cells if move.door in last else _NO_CELLS
        if not len(before) and not len(move.cells):
            continue
        last[move.door] = move
        touched = sorted({*before.tolist(), *move.cells.tolist()})
        shown_before = _shown(doors_at, touched)
        for cell in before.tolist():
            doors_at[cell].remove(move.door)
        for cell in move.cells.tolist():
            insort(doors_at.setdefault(cell, []), move.door)
        shown_after = _shown(doors_at, touched)
        for door in sorted({move.door, *shown_before, *shown_after}):
            mine = [cell for cell in last[door].cells.tolist() if doors_at[cell][-1] == door]
            versions.setdefault(door, []).append((move.stamp, _patch(last[door], mine)))
    return versions


def grid_around(doors: Iterable[DoorRows], level: int) -> GridGeometry | None:
    """Return a grid of 0.05 m that contains all places of a level's doors; None: there is none."""
    corners = [np.zeros((0, 2))]
    for rows in doors:
        here = _placed(rows.placements[rows.placements["level"] == level])
        corners.append(rows.shape.points(here))
    points = np.concatenate(corners)
    if not len(points):
        return None
    low = np.floor(points.min(axis=0) / RESOLUTION_M) - 1
    width, height = np.floor(points.max(axis=0) / RESOLUTION_M) + 2 - low
    if not 0 < width <= MOST_CELLS / height:
        return None
    return GridGeometry(int(width), int(height), RESOLUTION_M, *(low * RESOLUTION_M).tolist())


def _placed(rows: Changes) -> Changes:
    is_placed = np.isfinite(rows["x"] + rows["y"] + rows["theta"] + rows["width"])
    placed: Changes = rows[is_placed]
    return placed


@dataclass(frozen=True, slots=True)
class _Move:
    """A door is put somewhere, or taken away."""

    stamp: Stamp
    door: DoorId
    window: CellWindow | None
    cells: Cells
    """Flat, in the level's grid; none: it is taken away."""
    columns: int
    """Of the grid."""


def _moves(
    doors: Mapping[DoorId, DoorRows], level: int, geometry: GridGeometry, order: Order
) -> list[_Move]:
    """Return all moves of doors that are on a level at some time, in that order."""
    parts = [np.concatenate([rows.placements, rows.removals]) for rows in doors.values()]
    owner = [door for door, part in zip(doors, parts, strict=True) for _ in range(len(part))]
    rows = np.concatenate([np.empty(0, CHANGE), *parts])
    is_removal = np.concatenate(
        [np.zeros(0, np.bool_)]
        + [np.arange(len(r.placements) + len(r.removals)) >= len(r.placements)
           for r in doors.values()]
    )  # fmt: skip
    stays = ~is_removal & (rows["level"] == level)
    lines = {
        index: doors[owner[index]].shape.drawn(rows[index])
        for index in np.flatnonzero(stays).tolist()
    }
    place, cells = cells_of(geometry, lines)
    parts_of = dict(zip(lines, np.split(cells, np.searchsorted(place, np.arange(1, len(lines)))),
                        strict=False))  # fmt: skip
    return [
        _move(rows[[i]], owner[i], parts_of.get(i, _NO_CELLS), geometry.width)
        for i in order(rows).tolist()
    ]


_NO_CELLS = np.empty(0, np.int64)


def _move(stamp: Stamp, door: DoorId, cells: Cells, columns: int) -> _Move:
    if len(cells):
        y, x = np.divmod(cells, columns)
        window = CellWindow(int(x.min()), int(y.min()), int(x.max()) + 1, int(y.max()) + 1)
        if window.area <= MOST_PATCH_CELLS:
            return _Move(stamp, door, window, cells, columns)
    return _Move(stamp, door, None, cells, columns)


def _shown(doors_at: Mapping[int, list[DoorId]], cells: Iterable[int]) -> set[DoorId]:
    return {doors[-1] for cell in cells if (doors := doors_at.get(cell))}


def _patch(move: _Move, mine: Sequence[int]) -> Patch | None:
    """Return the cells of a door that it shows; None: there are none."""
    if move.window is None or not mine:
        return None
    y, x = np.divmod(np.array(mine), move.columns)
    shown = np.zeros(move.window.shape, np.bool_)
    shown[y - move.window.y0, x - move.window.x0] = True
    return Patch(move.window, shown.tobytes())


STAMPS = ("number", "folds_ns", "recorded_ns")
STATE = np.dtype([(name, "i8") for name in STAMPS] + [("state", "u1")])
"""What is kept of a change of state until the recording is written: there may be millions."""


@dataclass(frozen=True, slots=True)
class DoorRows:
    """A door's events along a timeline, in the order in which they count there."""

    states: Changes
    """Rows of `STATE`."""
    placements: Changes
    """Rows of `CHANGE`, as the removals."""
    removals: Changes
    shape: ObjectShape = AS_A_DOOR

    @classmethod
    def of(cls, picture: DoorPicture, shape: ObjectShape) -> DoorRows:
        """Return the rows that a picture needs."""
        return cls(slim(picture.states), picture.placements, picture.removals, shape)

    def __len__(self) -> int:
        """How many there are."""
        return len(self.states) + len(self.placements) + len(self.removals)

    @property
    def last_number(self) -> int:
        """Of the event that was recorded last."""
        parts = (self.states, self.placements, self.removals)
        return max(int(part["number"].max()) for part in parts if len(part))

    @classmethod
    def joined(cls, pieces: Sequence[DoorRows]) -> DoorRows:
        """Return all of a door's rows, from their pieces."""
        fields = ((one.states, one.placements, one.removals) for one in pieces)
        states, placements, removals = map(np.concatenate, zip(*fields, strict=True))
        return cls(states, placements, removals, pieces[-1].shape)

    def last(self) -> DoorRows:
        """Return the final values, from which later rows continue."""
        return DoorRows(self.states[-1:], self.placements[-1:], self.removals[-1:], self.shape)


def slim(changes: Changes) -> Changes:
    """Return the stamps and states of changes alone."""
    states = np.empty(len(changes), STATE)
    for name in STATE.names or ():
        states[name] = changes[name]
    return states


Order = Callable[[Changes], NDArray[np.intp]]


def happened_order(rows: Changes) -> NDArray[np.intp]:
    """Return the order in which rows count."""
    return np.lexsort((rows["number"], rows["folds_ns"]))


def recorded_order(rows: Changes) -> NDArray[np.intp]:
    """Return the order in which rows were recorded."""
    return np.argsort(rows["number"], kind="stable")
