"""One door's events as rows to draw: where it becomes something else. Pure numpy."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.folds.door_changes import CHANGE, THERE, Changes, of_presence
from semmap_log.core.model.meaning import PART_OF, PARTS, PLACING, Presence
from semmap_log.views.excerpt.door_rows import NO_STATE

PLACE = tuple(name for name, part in PART_OF.items() if part & PLACING)
PROBABILITIES = ("prob_open", "prob_closed")


@dataclass(frozen=True, slots=True)
class DoorPicture:
    """Rows to draw for one door, each with all its values from then on."""

    states: Changes
    """One a state."""
    placements: Changes
    """One a place; NaN: it has none."""
    probabilities: Changes
    """One a point of the curves; NaN where not given."""
    removals: Changes
    """From then on it is not in the map."""
    returns: Changes
    """From then on it is in the map, or again."""


class DoorFold:
    """Follows one door and remembers only its last values.

    A door that is not there is not drawn; what is told of it then is, once it comes.
    """

    def __init__(self) -> None:
        self.last: Changes = np.zeros(1, CHANGE)
        """One row: the values after the last event taken."""
        self.last["state"] = NO_STATE
        for name in PART_OF:
            if CHANGE[name].kind == "f":
                self.last[name] = np.nan
        self.is_there = False

    def take(self, changes: Changes) -> DoorPicture:
        """Return what the next events draw.

        Args:
            changes: In the order in which they count; none sets what it does not win.
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

    def _fill_forward(self, rows: Changes) -> Changes:
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

    def _presence(self, changes: Changes) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Tell for each row whether the door is there since, and whether it was there before."""
        sets = np.flatnonzero((changes["sets"] & THERE) != 0)
        brings = np.append(self.is_there, ~of_presence(changes[sets], Presence.GOES))
        place = np.searchsorted(sets, np.arange(len(changes)), "right")
        there: NDArray[np.bool_] = brings[place]
        was_there = np.append(self.is_there, there)[: len(changes)]
        if len(there):
            self.is_there = bool(there[-1])
        return there, was_there


def _differs(rows: Changes, before: Changes, names: Iterable[str]) -> NDArray[np.bool_]:
    """Tell which rows have other values than the rows before them; NaN is like NaN."""
    found = np.zeros(len(rows), np.bool_)
    for name in names:
        one, other = before[name], rows[name]
        found |= (one != other) & ~(np.isnan(one) & np.isnan(other))
    return found
