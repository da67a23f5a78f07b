"""Rows of door changes for drawing: where they begin, whose they are, which of them count.

One door's events become rows at which it changes. On a floor plan a door is a line; other objects
may be areas or points. Pure numpy.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, NO_INFORMATION, DoorLine
from semmap_log.analysis.costmaps.door_layer_fold import cost_of_state
from semmap_log.core.folds import door_changes
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model import doors as door_model
from semmap_log.core.model.events import DoorAdded
from semmap_log.core.model.meaning import FIELDS, PART_OF, PARTS, PLACING, Presence

PLACE = tuple(name for name, part in PART_OF.items() if part & PLACING)
PROBABILITIES = ("prob_open", "prob_closed")


@dataclass(frozen=True, slots=True)
class DoorPicture:
    """Rows to draw for one door, each with all its values from then on."""

    states: door_changes.Changes
    """One a state."""
    placements: door_changes.Changes
    """One row a place; NaN: it has no place."""
    probabilities: door_changes.Changes
    """One row a point of the curves; NaN where not given."""
    removals: door_changes.Changes
    """When it leaves the map."""
    returns: door_changes.Changes
    """When it enters the map, or returns to it."""


class DoorFold:
    """Follows one door and remembers only its last values.

    A door that is not in the map is not drawn; what is reported about it then is shown once it is
    added.
    """

    def __init__(self) -> None:
        self.last: door_changes.Changes = np.zeros(1, door_changes.CHANGE)
        """One row: the values after the last event taken."""
        self.last["state"] = NO_STATE
        for name in PART_OF:
            if door_changes.CHANGE[name].kind == "f":
                self.last[name] = np.nan
        self.is_there = False

    def take(self, changes: door_changes.Changes) -> DoorPicture:
        """Return what the next events draw.

        Args:
            changes: In the order in which they count; none sets a value that a newer one has set.
        """
        rows = changes.copy()
        before = self._fill_forward(rows)
        there, was_there = self._presence(changes)
        appears = there & ~was_there
        has_probability = ~(np.isnan(rows["prob_open"]) & np.isnan(rows["prob_closed"]))
        return DoorPicture(
            states=rows[there & (appears | _differs(rows, before, ["state"]))],
            placements=rows[there & (appears | _differs(rows, before, PLACE))],
            probabilities=rows[
                there & np.where(appears, has_probability, _differs(rows, before, PROBABILITIES))
            ],
            removals=rows[was_there & ~there],
            returns=rows[appears],
        )

    def _fill_forward(self, rows: door_changes.Changes) -> door_changes.Changes:
        """Give each row the values that it does not set; return those before each row."""
        for part, names in PARTS.items():
            sets = (rows["sets"] & int(part)) != 0
            if sets.all():
                continue
            source = np.maximum.accumulate(np.where(sets, np.arange(len(rows)), -1))
            for name in names:
                rows[name] = np.where(source >= 0, rows[name][source], self.last[name])
        before = np.concatenate([self.last, rows])[: len(rows)]
        if len(rows):
            self.last = rows[-1:].copy()
        return before

    def _presence(
        self, changes: door_changes.Changes
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return for each row whether the door exists after it, and whether it existed before."""
        sets = np.flatnonzero((changes["sets"] & door_changes.THERE) != 0)
        brings = np.append(self.is_there, ~door_changes.of_presence(changes[sets], Presence.GOES))
        place = np.searchsorted(sets, np.arange(len(changes)), "right")
        there: NDArray[np.bool_] = brings[place]
        was_there = np.append(self.is_there, there)[: len(changes)]
        if len(there):
            self.is_there = bool(there[-1])
        return there, was_there


def _differs(
    rows: door_changes.Changes, before: door_changes.Changes, names: Iterable[str]
) -> NDArray[np.bool_]:
    """Return which rows differ in value from the rows before them; NaN equals NaN."""
    found = np.zeros(len(rows), np.bool_)
    for name in names:
        one, other = before[name], rows[name]
        found |= (one != other) & ~(np.isnan(one) & np.isnan(other))
    return found


POINT_M = 0.15
"""How far the corners of a point's diamond are from where it is."""
_DIAMOND = ((POINT_M, 0.0), (0.0, POINT_M), (-POINT_M, 0.0), (0.0, -POINT_M))


@dataclass(frozen=True, slots=True)
class ObjectShape:
    """What an object looks like, wherever it is put."""

    object_class: door_model.ObjectClass = door_model.DOOR
    outline: door_model.Corners = ()
    """Of a polygon, in its own frame, metres; empty: unknown."""

    @property
    def is_line(self) -> bool:
        """Whether it is a line, such as a door, that stands in a wall."""
        return self.object_class.geometry is door_model.Geometry.SEGMENT

    def strips(self, placements: door_changes.Changes) -> NDArray[np.float32]:
        """Return its lines, float32 (rows, points, x and y), metres, frame `map`."""
        corners = (
            self.outline if self.object_class.geometry is door_model.Geometry.POLYGON else _DIAMOND
        )
        if self.is_line or not corners:
            return strips_of(placements)
        with np.errstate(over="ignore"):  # as in `strips_of`
            return _seen_from(placements, np.array([*corners, corners[0]])).astype(np.float32)

    def points(self, placements: door_changes.Changes) -> NDArray[np.float64]:
        """Return the corners of its extent, (points, x and y), metres, frame `map`."""
        if self.outline:
            return _seen_from(placements, np.array(self.outline)).reshape(-1, 2)
        start = np.stack([placements["x"], placements["y"]], -1)
        along = np.stack([np.cos(placements["theta"]), np.sin(placements["theta"])], -1)
        width = placements["width"] if self.is_line else np.zeros(len(placements))
        return np.concatenate([start, start + width[:, None] * along])

    def drawn(self, placement: Any) -> DoorLine:
        """Return its line or outline in a costmap, without a cost of its own."""
        x, y, theta, width = (float(placement[name]) for name in ("x", "y", "theta", "width"))
        width = width if self.is_line else 0.0
        corners: door_model.Corners = ()
        if self.outline:
            seen = _seen_from(placement[None], np.array(self.outline))[0]
            corners = tuple((float(corner[0]), float(corner[1])) for corner in seen)
        return DoorLine(x, y, theta, width, NO_INFORMATION, corners)

    def costs(self) -> NDArray[np.uint8]:
        """Return the cost of each of its states: uint8 (256,)."""
        costs = np.full(256, NO_INFORMATION, np.uint8)
        costs[: len(door_model.DoorState)] = [
            cost_of_state(state, self.object_class) for state in door_model.DoorState
        ]
        if not self.is_line:
            costs[costs == FREE_SPACE] = NO_INFORMATION
        return costs


AS_A_DOOR = ObjectShape()


def shapes_of(state: DoorMapState) -> Mapping[door_model.DoorId, ObjectShape]:
    """Return the shapes of all objects other than doors, removed ones included."""
    objects = state.objects()
    said = state.since_added(door_model.OUTLINE) if objects else {}
    return {i: ObjectShape(one, _outline(said.get(i, ""))) for i, one in objects.items()}


def _outline(text: str) -> door_model.Corners:
    try:
        return door_model.parse_outline(text)
    except ValueError:
        return ()


def _seen_from(
    placements: door_changes.Changes, corners: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return corners of objects, (rows, corners, x and y), in the frame `map`."""
    starts = np.stack([placements["x"], placements["y"]], -1)
    cos, sin = np.cos(placements["theta"])[:, None], np.sin(placements["theta"])[:, None]
    x, y = corners[None, :, 0], corners[None, :, 1]
    turned = np.stack([cos * x - sin * y, sin * x + cos * y], -1)
    seen: NDArray[np.float64] = turned + starts[:, None]
    return seen


ALWAYS: door_changes.Stamp = (-1, -1)
NEVER: door_changes.Stamp = (2**63 - 1, 2**63 - 1)

NO_STATE = 255


@dataclass(frozen=True, slots=True)
class RecordingEdge:
    """Where a recording begins or ends, on each of its timelines."""

    folds_ns: int
    number: int
    recorded_ns: int

    def stamp(self, changes: door_changes.Changes) -> None:
        """Put the rows there."""
        changes["folds_ns"], changes["number"] = self.folds_ns, self.number
        changes["recorded_ns"] = self.recorded_ns


def opening_changes(doors: Iterable[door_model.Door], begin: RecordingEdge) -> door_changes.Changes:
    """Return one row a door with its full state, to begin a recording amid the log."""
    listed = list(doors)
    opening = np.zeros(len(listed), door_changes.CHANGE)
    opening["kind"], opening["sets"] = DoorAdded.kind, door_changes.EVERYTHING
    begin.stamp(opening)
    for name in ("door_id", *FIELDS):
        opening[name] = [getattr(door, name) for door in listed]
    return opening


def by_door(changes: door_changes.Changes) -> Iterator[door_changes.Changes]:
    """Yield each door's rows, doors ascending, rows in the order they came."""
    if len(changes):
        ordered = changes[np.argsort(changes["door_id"], kind="stable")]
        yield from np.split(ordered, np.flatnonzero(np.diff(ordered["door_id"])) + 1)


def sorted_by_stamp(changes: door_changes.Changes) -> door_changes.Changes:
    """Return the rows in the order in which they count."""
    return changes[np.lexsort((changes["number"], changes["folds_ns"]))]


@dataclass(frozen=True, slots=True)
class DoorLifetime:
    """When a door is in the map, with all that is known."""

    added: door_changes.Stamp = NEVER
    removed: door_changes.Stamp = NEVER

    def covers(self, changes: door_changes.Changes) -> NDArray[np.bool_]:
        """Return for each row whether the door exists, from its addition up to its removal."""
        return ~door_changes.is_before(changes, self.added) & door_changes.is_before(
            changes, self.removed
        )


def strips_of(placements: door_changes.Changes) -> NDArray[np.float32]:
    """Return the doors' lines, float32 (rows, 2 ends, x and y), metres, frame `map`."""
    starts = np.stack([placements["x"], placements["y"]], -1)
    along = np.stack([np.cos(placements["theta"]), np.sin(placements["theta"])], -1)
    ends = starts + placements["width"][:, None] * along
    with np.errstate(over="ignore"):  # what float32 cannot hold is nowhere near a building
        return np.stack([starts, ends], 1).astype(np.float32)
