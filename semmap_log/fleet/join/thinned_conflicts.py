"""Where logs that are joined disagree about a door while the sightings of one were thinned.

A log that was thinned keeps the first and the last of sightings that repeat each other. If another
log saw the door otherwise in between, its state until the last of them cannot be known any more.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.folds.state_rows import COMES, STATE_ROW, state_rows
from semmap_log.core.model.events import STATE_KINDS, SightingsThinned
from semmap_log.fleet.join.door_plan import DoorPlan
from semmap_log.fleet.join.joined_logs import JoinedLog, JoinedLogs
from semmap_log.store.kind_bits import bits_of_kinds
from semmap_log.store.reading.window import Window


def known_again_ns(joined: JoinedLogs, plan: DoorPlan) -> int:
    """Return when the last of such sightings was recorded (ns); -1: there is no such conflict."""
    thinned = {log.name: runs for log in joined.logs if len(runs := _thinned(log, plan))}
    if not thinned or len(joined.logs) < 2:
        return -1
    rows = {log.name: _states_of(log, plan) for log in joined.logs}
    return max(
        (
            known_ns
            for name, runs in thinned.items()
            for known_ns in _known_again(runs, rows[name], _others(rows, name))
        ),
        default=-1,
    )


def _known_again(
    runs: NDArray[np.void], own: NDArray[np.void], others: NDArray[np.void]
) -> Iterator[int]:
    """Yield when the last sighting of each run with a conflict was recorded.

    Args:
        runs: What was thinned of a log.
        own: The states that it keeps, by door and time.
        others: Those of the other logs, by door and time.
    """
    for run in runs:
        mine, theirs = (_of_door(rows, run["door_id"]) for rows in (own, others))
        before = int(np.searchsorted(mine["folds_ns"], run["first_ns"], "right")) - 1
        start_ns = mine["folds_ns"][before] if before >= 0 else run["first_ns"]
        first, end = np.searchsorted(theirs["folds_ns"], [start_ns, run["last_ns"]])
        if (theirs["state"][first:end] != run["state"]).any():
            last = int(np.searchsorted(mine["folds_ns"], run["last_ns"], "right"))
            after = mine["recorded_ns"][last : last + 1]
            yield int(max(run["recorded_ns"] if not len(after) else after[0], run["last_ns"]))


def _of_door(rows: NDArray[np.void], door_id: int) -> NDArray[np.void]:
    first, end = np.searchsorted(rows["door_id"], [door_id, door_id + 1])
    return rows[first:end]


def _others(rows: dict[str, NDArray[np.void]], name: str) -> NDArray[np.void]:
    found = [each for other, each in rows.items() if other != name]
    return _sorted(np.concatenate(found))


def _states_of(log: JoinedLog, plan: DoorPlan) -> NDArray[np.void]:
    """Return the states that a log tells of the building's doors, by door and time."""
    reader = log.opened
    hidden = reader.retractions()
    window = Window(kinds=bits_of_kinds(STATE_KINDS), first_event=reader.horizon or None)
    rows = state_rows(map(hidden.visible, reader.batches(window)))
    rows = rows[rows["state"] < COMES]
    return _sorted(_in_building(rows, log, plan))


def _thinned(log: JoinedLog, plan: DoorPlan) -> NDArray[np.void]:
    """Return what was thinned of a log, with the doors' numbers in the building."""
    reader = log.opened
    hidden, found = reader.retractions(), [np.empty(0, _RUN)]
    window = Window(kinds=bits_of_kinds([SightingsThinned]), first_event=reader.horizon or None)
    for batch in reader.batches(window):
        told = hidden.visible(batch)
        if len(told):
            rows = np.zeros(len(told), _RUN)
            rows["recorded_ns"] = told.recorded_ns
            for name in ("door_id", "state", "first_ns", "last_ns"):
                rows[name] = told[SightingsThinned][name]
            found.append(rows)
    return _in_building(np.concatenate(found), log, plan)


def _in_building(rows: NDArray[np.void], log: JoinedLog, plan: DoorPlan) -> NDArray[np.void]:
    own, building = plan.ids[log.name]
    rows = rows[np.isin(rows["door_id"], own)]
    rows["door_id"] = building[np.searchsorted(own, rows["door_id"])]
    return rows


def _sorted(rows: NDArray[np.void]) -> NDArray[np.void]:
    assert rows.dtype == STATE_ROW
    return rows[np.lexsort((rows["number"], rows["folds_ns"], rows["door_id"]))]


_RUN: np.dtype[np.void] = np.dtype(
    [("door_id", "u4"), ("state", "u1"), ("first_ns", "i8"), ("last_ns", "i8"),
     ("recorded_ns", "i8")]
)  # fmt: skip
