"""The costmap's door layer, door by door: which cells each one shows, and from when. Pure numpy.

Of several doors on a cell the one with the greatest id has it, whatever its state (an unknown one
erases): so a door shows the cells of its line that no door with a greater id lies on. Its picture
changes with its state, and with where it and those on its cells are put.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.costmap.costs import NO_INFORMATION
from semmap_log.costmap.door_layer import DoorLine, cells_of
from semmap_log.costmap.grid import MOST_CELLS, GridGeometry, Window
from semmap_log.doors import DoorId, DoorState
from semmap_log.projections.door_layer import cost_of_state
from semmap_log.views.rerun.door_rows import CHANGE, NO_STATE, Changes

RESOLUTION_M = 0.05
"""Of a level without a floor map: that of `CostmapOptions`."""

MOST_PATCH_CELLS = 2**18
"""A door of 25 m, drawn across; a longer one would fill the recording, and shows its line alone."""

PICTURE = np.dtype(
    [("number", "i8"), ("folds_ns", "i8"), ("recorded_ns", "i8"), ("patch", "i4"), ("cost", "u1")]
)
"""From when a door shows which of its patches at which cost; patch `NO_PATCH`: it shows nothing."""
STAMPS = ("number", "folds_ns", "recorded_ns")
STATE = np.dtype([(name, "i8") for name in STAMPS] + [("state", "u1")])
"""All that is kept of a change of state until the recording is written: there may be millions."""
NO_PATCH = -1

Pictures = NDArray[np.void]

COSTS = np.full(256, NO_INFORMATION, np.uint8)
"""State -> cost."""
COSTS[: len(DoorState)] = [cost_of_state(state) for state in DoorState]


@dataclass(frozen=True, slots=True)
class Patch:
    """The cells that a door shows."""

    window: Window
    shown: bytes
    """bool, rows of the window one after the other."""

    def costs(self, cost: int) -> NDArray[np.uint8]:
        """Return the window of the layer, (rows, columns), as far as it is this door's."""
        shown = np.frombuffer(self.shown, np.bool_).reshape(self.window.shape)
        costs: NDArray[np.uint8] = np.where(shown, np.uint8(cost), np.uint8(NO_INFORMATION))
        return costs


@dataclass(frozen=True, slots=True)
class DoorRows:
    """What happens to a door, as `DoorFold` gives it, in the order in which it counts."""

    states: Changes
    """Rows of `STATE`."""
    late_states: NDArray[np.bool_]
    placements: Changes
    """Rows of `CHANGE`, as the removal."""
    late_placements: NDArray[np.bool_]
    removal: Changes

    @classmethod
    def joined(cls, pieces: Sequence[DoorRows]) -> DoorRows:
        """Return all of a door's rows, of which these are the pieces."""
        return cls(*(np.concatenate(parts) for parts in zip(*map(_fields, pieces), strict=True)))

    def as_recorded(self) -> DoorRows:
        """Return those that counted when they were recorded, in the order of recording."""
        return DoorRows(
            _by_number(self.states[~self.late_states]), np.zeros(0, np.bool_),
            _by_number(self.placements[~self.late_placements]), np.zeros(0, np.bool_),
            self.removal,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class DoorPatches:
    """A door's pictures on one level, over time."""

    patches: Sequence[Patch]
    pictures: Pictures


def patches_along(
    doors: Mapping[DoorId, DoorRows], level: int, geometry: GridGeometry, *, recorded: bool
) -> Iterator[tuple[DoorId, DoorPatches]]:
    """Yield what each door shows of a level's layer.

    Args:
        doors: Id -> its rows, in the order in question.
        level: The level.
        geometry: Of the layer.
        recorded: In the order of recording; else in that of happening.
    """
    order = _recorded_order if recorded else _happened_order
    moves = _moves(doors, level, geometry, order)
    for door, versions in _versions(moves).items():
        yield door, _door_patches(doors[door], versions, order, recorded=recorded)


def slim(changes: Changes) -> Changes:
    """Return the stamps and states of changes alone."""
    states = np.empty(len(changes), STATE)
    for name in STATE.names or ():
        states[name] = changes[name]
    return states


def grid_around(doors: Iterable[DoorRows], level: int) -> GridGeometry | None:
    """Return a grid of 0.05 m that holds all places of doors on a level; None: there is none."""
    corners = [np.zeros((0, 2))]
    for rows in doors:
        here = _placed(rows.placements[rows.placements["level"] == level])
        start = np.stack([here["x"], here["y"]], -1)
        along = np.stack([np.cos(here["theta"]), np.sin(here["theta"])], -1)
        corners += [start, start + here["width"][:, None] * along]
    points = np.concatenate(corners)
    if not len(points):
        return None
    low = np.floor(points.min(axis=0) / RESOLUTION_M) - 1
    width, height = np.floor(points.max(axis=0) / RESOLUTION_M) + 2 - low
    if not 0 < width <= MOST_CELLS / height:
        return None
    return GridGeometry(int(width), int(height), RESOLUTION_M, *(low * RESOLUTION_M).tolist())


Order = Callable[[Changes], NDArray[np.intp]]


def _happened_order(rows: Changes) -> NDArray[np.intp]:
    return np.lexsort((rows["number"], rows["folds_ns"]))


def _recorded_order(rows: Changes) -> NDArray[np.intp]:
    return np.argsort(rows["number"], kind="stable")


def _by_number(rows: Changes) -> Changes:
    ordered: Changes = rows[_recorded_order(rows)]
    return ordered


def _fields(rows: DoorRows) -> tuple[NDArray[np.generic], ...]:
    return rows.states, rows.late_states, rows.placements, rows.late_placements, rows.removal


def _placed(rows: Changes) -> Changes:
    is_placed = np.isfinite(rows["x"] + rows["y"] + rows["theta"] + rows["width"])
    placed: Changes = rows[is_placed]
    return placed


Cells = NDArray[np.int64]
Stamp = Changes
"""One row."""


@dataclass(frozen=True, slots=True)
class _Move:
    """A door is put somewhere, or taken away."""

    stamp: Stamp
    door: DoorId
    window: Window | None
    cells: Cells
    """Flat, in the level's grid; none: it is taken away."""
    columns: int
    """Of the grid."""


def _moves(
    doors: Mapping[DoorId, DoorRows], level: int, geometry: GridGeometry, order: Order
) -> list[_Move]:
    """Return all moves of doors that are on a level at some time, in that order."""
    parts = [np.concatenate([rows.placements, rows.removal]) for rows in doors.values()]
    owner = np.repeat(np.array(list(doors), np.int64), [len(part) for part in parts])
    rows = np.concatenate([np.empty(0, CHANGE), *parts])
    is_removal = np.concatenate(
        [np.zeros(0, np.bool_)]
        + [np.arange(len(r.placements) + len(r.removal)) >= len(r.placements)
           for r in doors.values()]
    )  # fmt: skip
    stays = ~is_removal & (rows["level"] == level)
    lines = {index: _line(rows[index]) for index in np.flatnonzero(stays).tolist()}
    place, cells = cells_of(geometry, lines)
    parts_of = dict(zip(lines, np.split(cells, np.searchsorted(place, np.arange(1, len(lines)))),
                        strict=False))  # fmt: skip
    return [
        _move(rows[[i]], DoorId(int(owner[i])), parts_of.get(i, _NO_CELLS), geometry.width)
        for i in order(rows).tolist()
    ]


_NO_CELLS = np.empty(0, np.int64)


def _line(row: Any) -> DoorLine:
    return DoorLine(
        float(row["x"]), float(row["y"]), float(row["theta"]), float(row["width"]), NO_INFORMATION
    )


def _move(stamp: Stamp, door: DoorId, cells: Cells, columns: int) -> _Move:
    if len(cells):
        y, x = np.divmod(cells, columns)
        window = Window(int(x.min()), int(y.min()), int(x.max()) + 1, int(y.max()) + 1)
        if window.area <= MOST_PATCH_CELLS:
            return _Move(stamp, door, window, cells, columns)
    return _Move(stamp, door, None, cells, columns)


def _versions(moves: Iterable[_Move]) -> dict[DoorId, list[tuple[Stamp, Patch | None]]]:
    """Return, for each door that has a place at some time, from when it shows which cells."""
    versions: dict[DoorId, list[tuple[Stamp, Patch | None]]] = {}
    last: dict[DoorId, _Move] = {}
    doors_at: dict[int, list[DoorId]] = {}
    for move in moves:
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
            versions.setdefault(door, []).append((move.stamp, _patch(last[door], doors_at)))
    return versions


def _shown(doors_at: Mapping[int, list[DoorId]], cells: Iterable[int]) -> set[DoorId]:
    return {doors[-1] for cell in cells if (doors := doors_at.get(cell))}


def _patch(move: _Move, doors_at: Mapping[int, list[DoorId]]) -> Patch | None:
    if move.window is None:
        return None
    mine = [cell for cell in move.cells.tolist() if doors_at[cell][-1] == move.door]
    if not mine:
        return None
    y, x = np.divmod(np.array(mine), move.columns)
    shown = np.zeros(move.window.shape, np.bool_)
    shown[y - move.window.y0, x - move.window.x0] = True
    return Patch(move.window, shown.tobytes())


def _door_patches(
    rows: DoorRows,
    versions: Sequence[tuple[Stamp, Patch | None]],
    order: Order,
    *,
    recorded: bool,
) -> DoorPatches:
    """Join a door's states and its patches: one row each time that it looks otherwise."""
    numbers: dict[Patch, int] = {}
    at = [NO_PATCH if patch is None else numbers.setdefault(patch, len(numbers))
          for _, patch in versions]  # fmt: skip
    stamps = np.concatenate([rows.states, *(slim(stamp) for stamp, _ in versions)])
    is_state = np.arange(len(stamps)) < len(rows.states)
    patch_of = np.concatenate([np.zeros(len(rows.states), np.int64), np.array(at, np.int64)])
    chosen = order(stamps)
    stamps, is_state, patch_of = stamps[chosen], is_state[chosen], patch_of[chosen]

    pictures = np.zeros(len(stamps), PICTURE)
    for name in STAMPS:
        pictures[name] = stamps[name]
    pictures["cost"] = COSTS[_held(stamps["state"], is_state, NO_STATE)]
    pictures["patch"] = _held(patch_of, ~is_state, NO_PATCH)
    nothing = (pictures["cost"] == NO_INFORMATION) | (pictures["patch"] == NO_PATCH)
    pictures["cost"][nothing], pictures["patch"][nothing] = NO_INFORMATION, NO_PATCH
    return DoorPatches(list(numbers), _changes_of_look(pictures, recorded=recorded))


def _held(values: NDArray[np.generic], sets: NDArray[np.bool_], before: int) -> NDArray[np.int64]:
    """Return at each row the value of the last row that set one."""
    source = np.maximum.accumulate(np.where(sets, np.arange(len(sets)), -1))
    held: NDArray[np.int64] = np.where(source >= 0, values.astype(np.int64)[source], before)
    return held


def _changes_of_look(pictures: Pictures, *, recorded: bool) -> Pictures:
    """Keep the last row of each time, and of those the ones that show something else."""
    time = pictures["number" if recorded else "folds_ns"]
    pictures = pictures[np.append(time[1:] != time[:-1], True)[: len(time)]]
    look = pictures["patch"].astype(np.int64) * 256 + pictures["cost"]
    nothing = NO_PATCH * 256 + NO_INFORMATION
    differs = look != np.append(nothing, look[:-1])[: len(look)]
    kept: Pictures = pictures[differs]
    return kept
