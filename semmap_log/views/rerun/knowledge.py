"""What was known of a door as its events were recorded: late ones, and ones that were taken back.

Recorded late, an event sets only what nothing newer has set by then. What a retraction does comes
out of the project's own fold: from there on a door goes on from what `state_at` says of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from semmap_log.core.folds.door_changes import CHANGE, EVERYTHING, THERE, Changes, Stamp
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, DoorRemoved
from semmap_log.core.model.meaning import PARTS, REGISTER_OF, REGISTERS
from semmap_log.views.excerpt.door_rows import ALWAYS, RecordingEdge


@dataclass(frozen=True, slots=True)
class KnownDoor:
    """All that was known of a door from some moment of recording on."""

    row: Changes
    """One row, which sets everything."""
    stamps: Mapping[int, Stamp]
    """Bit of `sets` -> the event that had said so."""

    @property
    def is_there(self) -> bool:
        """Whether it was in the map."""
        return bool(self.row["kind"][0] != DoorRemoved.kind)

    @property
    def is_placed(self) -> bool:
        """Whether it had a place, or would have one if it were in the map."""
        return bool(np.isfinite(self.row["x"][0]))

    @property
    def level(self) -> int:
        """Where that is."""
        return int(self.row["level"][0])

    @classmethod
    def of(cls, state: DoorMapState, door_id: DoorId, since: RecordingEdge) -> KnownDoor:
        """Return what a fold of what was known has of a door."""
        row = np.zeros(1, CHANGE)
        since.stamp(row)
        row["door_id"], row["sets"] = door_id, EVERYTHING
        row["kind"] = (DoorAdded if state.is_present(door_id) else DoorRemoved).kind
        stamps: dict[int, Stamp] = {}
        for part, register in REGISTER_OF.items():
            _, _, values = state.register_of(np.array([door_id]), register)
            stamps[int(part)] = state.stamp(door_id, register) or ALWAYS
            for name in REGISTERS[register]:
                row[name] = values[name]
        came_and_went = [state.stamp(door_id, register) for register in ("added", "removed")]
        stamps[THERE] = max(stamp or ALWAYS for stamp in came_and_went)
        return cls(row, stamps)


def as_recorded(changes: Changes, known: Sequence[KnownDoor]) -> Changes:
    """Return a door's rows in the order of recording, each setting only what it won then.

    Args:
        changes: Its events, numbers ascending, also those that were taken back later.
        known: From where the door goes on from something else: at the beginning, and behind each
            retraction of one of its events; numbers ascending.
    """
    cuts = np.searchsorted(changes["number"], [one.row["number"][0] for one in known], "right")
    parts: list[Changes] = [_winning(changes[: cuts[0]] if len(known) else changes, {})]
    for one, (start, stop) in zip(known, pairwise([*cuts.tolist(), len(changes)]), strict=True):
        parts.append(_winning(np.concatenate([one.row, changes[start:stop]]), one.stamps))
    rows: Changes = np.concatenate(parts)
    return rows


def _winning(changes: Changes, first: Mapping[int, Stamp]) -> Changes:
    """Return rows that set only what nothing before them has set with a greater stamp.

    Args:
        changes: Numbers ascending.
        first: Bit -> stamp of what the first row sets; empty: its own.
    """
    rows: Changes = changes.copy()
    for bit in (*map(int, PARTS), THERE):
        setting = np.flatnonzero((rows["sets"] & bit) != 0)
        folds_ns, number = rows["folds_ns"][setting], rows["number"][setting]
        if first:
            folds_ns[0], number[0] = first[bit]
        rank = np.empty(len(setting), np.int64)
        rank[np.lexsort((number, folds_ns))] = np.arange(len(setting))
        outdone = setting[rank < np.maximum.accumulate(rank)]
        rows["sets"][outdone] &= ~np.uint8(bit)
    return rows
