"""A door's pictures in the costmap's layer: which cells it shows at which cost, and from when.

They change with its state, and with where it and those on its cells are put. Pure numpy.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import NO_INFORMATION
from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.core.model.doors import DoorId
from semmap_log.views.excerpt.door_rows import NO_STATE
from semmap_log.views.rerun.costmap_cells import Patch, Version, versions_of
from semmap_log.views.rerun.costmap_doors import (
    STAMPS,
    DoorRows,
    Order,
    happened_order,
    recorded_order,
    slim,
)

PICTURE = np.dtype(
    [("number", "i8"), ("folds_ns", "i8"), ("recorded_ns", "i8"), ("patch", "i4"), ("cost", "u1")]
)
"""From when a door shows which of its patches at which cost; patch `NO_PATCH`: it shows nothing."""
NO_PATCH = -1

Pictures = NDArray[np.void]


@dataclass(frozen=True, slots=True)
class DoorPatches:
    """A door's pictures on one level, over time."""

    patches: Sequence[Patch]
    pictures: Pictures

    def behind(self, number: int) -> DoorPatches:
        """Return those from events with greater numbers."""
        return DoorPatches(self.patches, self.pictures[self.pictures["number"] > number])

    def within(self, spans: Sequence[TimeSpan], *, recorded: bool) -> DoorPatches:
        """Return what shows in some spans of time alone: it comes and goes with them.

        Args:
            spans: Their beginnings and ends, times ascending.
            recorded: The pictures are in the order of recording; else in that of happening.
        """
        parts = [_within(self.pictures, span, recorded=recorded) for span in spans]
        return DoorPatches(self.patches, np.concatenate([self.pictures[:0], *parts]))


class TimeSpan(NamedTuple):
    """From when on something shows, and when it is over; rows of `STAMPS`."""

    since: NDArray[np.void]
    """One row."""
    end: NDArray[np.void] | None
    """One row; None: it lasts."""


def _within(pictures: Pictures, span: TimeSpan, *, recorded: bool) -> Pictures:
    time = "number" if recorded else "folds_ns"
    times, first_time = pictures[time], span.since[time][0]
    first = int(np.searchsorted(times, first_time))
    behind = len(times) if span.end is None else int(np.searchsorted(times, span.end[time][0]))
    shown = pictures[first:behind]
    if first and not (len(shown) and shown[time][0] == first_time):
        shown = np.concatenate([_restamped(pictures[first - 1 : first], span.since), shown])
    if span.end is not None and len(shown):
        nothing = _restamped(shown[-1:], span.end)
        nothing["patch"], nothing["cost"] = NO_PATCH, NO_INFORMATION
        shown = np.concatenate([shown, nothing])
    return shown


def _restamped(picture: Pictures, stamp: NDArray[np.void]) -> Pictures:
    row: Pictures = picture.copy()
    for name in STAMPS:
        row[name] = stamp[name]
    return row


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
    order = recorded_order if recorded else happened_order
    for door, versions in versions_of(doors, level, geometry, order).items():
        yield door, _door_patches(doors[door], versions, order, recorded=recorded)


def _door_patches(
    rows: DoorRows,
    versions: Sequence[Version],
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
    pictures["cost"] = rows.shape.costs()[_held(stamps["state"], is_state, NO_STATE)]
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
