"""What a recording shows of doors, read back, and what a replay gives: to compare the two."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from semmap_log.log.door_log.door_log import DoorLog

TIMELINES = ("happened", "recorded", "event")
STATE, CLEAR, ROW = "StateChange:state", "Clear:is_recursive", "rerun.controls.RowId"

States = list[dict[int, str]]
"""Door -> state, at some moments along some timelines."""


def states_of(path: Path, numbers: Sequence[int], timelines: Sequence[str] = TIMELINES) -> States:
    """Return what replays give where these events stand."""
    import semmap_log as sl

    log = sl.read(path)
    scopes = {"happened": "at", "recorded": "known_at", "event": "event"}
    found = []
    for timeline in timelines:
        for number in numbers:
            how: dict[str, Any] = {scopes[timeline]: _place(log, number, timeline)}
            doors = log.replay(**how).doors
            found.append({int(door_id): door.state.name for door_id, door in doors.items()})
    return found


def states_in(
    rrd: Path, log: DoorLog, numbers: Sequence[int], timelines: Sequence[str] = TIMELINES
) -> States:
    """Return what a viewer would show there: of each door the latest state, if it is not gone."""
    rows = _door_rows(rrd)
    found = []
    for timeline in timelines:
        for number in numbers:
            at = _place(log, number, timeline)
            states = {door: _latest(told, timeline, at) for door, told in rows.items()}
            found.append({door: state for door, state in sorted(states.items()) if state})
    return found


def shape_of(rrd: Path) -> tuple[int, int]:
    """Return the rows of the longest chunk, and how many chunks there are."""
    from rerun.chunk import RrdReader

    rows = [chunk.num_rows for chunk in RrdReader(rrd).stream()]
    return max(rows), len(rows)


def _place(log: DoorLog, number: int, timeline: str) -> int:
    recorded = log.event(number)
    if timeline == "happened":
        return min(recorded.happened_ns, recorded.recorded_ns)
    return recorded.recorded_ns if timeline == "recorded" else number


Told = list[tuple[dict[str, Any], Any, list[str | None]]]
"""Chunk by chunk: times along each timeline, row ids, states; None: it vanishes."""


def _door_rows(rrd: Path) -> dict[int, Told]:
    from rerun.chunk import RrdReader

    found: dict[int, Told] = {}
    for chunk in RrdReader(rrd).stream().filter(content="/map/doors/**"):
        if chunk.is_static:
            continue
        batch = chunk.to_record_batch()
        names = batch.schema.names
        component = STATE if STATE in names else CLEAR if CLEAR in names else None
        if component is None:
            continue
        times = {name: np.array(batch.column(name).cast("int64")) for name in chunk.timeline_names}
        told = batch.column(component).to_pylist()
        states = [one[0] if one and component == STATE else None for one in told]
        door = int(chunk.entity_path.rsplit("_", 1)[1])
        found.setdefault(door, []).append((times, batch.column(ROW).to_pylist(), states))
    return found


def _latest(told: Told, timeline: str, at: int) -> str | None:
    best: tuple[int, Any] = (-1, b"")
    state = None
    for times, rows, states in told:
        if timeline not in times:
            continue
        place = int(np.searchsorted(times[timeline], at, "right")) - 1
        if place >= 0 and (here := (int(times[timeline][place]), rows[place])) > best:
            best, state = here, states[place]
    return state
