"""What lasts, and what was written, as rows: states of doors, rounds, poses, changes, commits."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

import numpy as np

from semmap_log.analysis.sql.made_tables import made_tables
from semmap_log.analysis.sql.view_columns import CHANGES, COMMITS, INTERVALS, PATROLS, POSES
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.table import times_array
from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.folds.patrol_rounds import ROUND_KINDS, Round, rounds
from semmap_log.core.model.commits import NOTE_TEXTS, Commit, Note
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import RobotPose
from semmap_log.core.model.moments import SECOND_NS
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.store.kind_bits import bits_of_kinds
from semmap_log.store.reading.window import Window

Tables = Iterator[pa.Table]


def interval_tables(log: DoorLog, doors: Collection[DoorId] | None) -> Tables:
    """Yield the states of doors that are, or were, in the map; None: of all."""
    names = log.door_names()
    found = log.timelines(doors)
    rows = (
        (door_id, names.get(door_id), each.start_ns, each.end_ns,
         each.duration_ns / SECOND_NS, each.state.name, each.event, each.sightings,
         each.seen_ns / SECOND_NS)
        for door_id, timeline in found.items()
        for each in timeline
    )  # fmt: skip
    return made_tables(INTERVALS, rows)


def change_tables(log: DoorLog, window: Window, doors: Collection[DoorId] | None) -> Tables:
    """Yield what events changed, in the order of their numbers.

    Args:
        log: The log.
        window: Which events.
        doors: Only those about these; None: all.
    """
    names = log.door_names()
    rows = (row for entry in log.history_in(window, doors) for row in _change_rows(entry, names))
    return made_tables(CHANGES, rows)


def commit_tables(log: DoorLog) -> Tables:
    """Yield the commits, in order."""
    return made_tables(COMMITS, map(_commit_row, log.commits()))


def patrol_tables(log: DoorLog) -> Tables:
    """Yield the rounds, as they were first heard of."""
    return made_tables(PATROLS, map(_round_row, rounds(log.history(kinds=ROUND_KINDS))))


def pose_tables(log: DoorLog, window: Window) -> Tables:
    """Yield where the robot was, retracted poses left out."""
    retractions = log.retractions()
    for batch in log.batches_in(window):
        seen = retractions.visible(batch)
        if RobotPose not in seen:
            continue
        rows, where = seen[RobotPose], seen.where(RobotPose)
        arrays = {
            "event": pa.array(seen.number[where]),
            "happened": times_array(seen.folds_ns[where]),
            "recorded": times_array(seen.recorded_ns[where]),
        }
        for column in POSES[len(arrays) :]:
            values = np.ascontiguousarray(rows[column.name])
            arrays[column.name] = pa.array(values, from_pandas=True)
        yield pa.table(arrays)


POSE_BITS = bits_of_kinds([RobotPose])


def _change_rows(entry: HistoryEntry, names: dict[DoorId, str]) -> Iterator[tuple[Any, ...]]:
    assert entry.door_id is not None or not entry.changes, "only doors change"
    for change in entry.changes:
        door_id = entry.door_id
        yield (
            entry.number, entry.kind, door_id, door_id and names.get(door_id),
            entry.folds_ns, entry.recorded_ns,
            change.field, _as_text(change.before), _as_text(change.after),
            entry.actor or None, entry.source or None, entry.reason or None,
            entry.correlation or None, entry.retracted,
        )  # fmt: skip


def _commit_row(commit: Commit) -> tuple[Any, ...]:
    return (
        commit.first_event, commit.last_event, commit.count,
        commit.recorded_ns, commit.wall_clock_ns, *_said(commit.note),
        commit.durability.name.lower(), commit.command_id.hex(), commit.hash.hex(),
    )  # fmt: skip


def _said(note: Note) -> Iterator[str | None]:
    return (getattr(note, name) or None for name in NOTE_TEXTS)


def _round_row(each: Round) -> tuple[Any, ...]:
    lasted = None
    if each.start_ns is not None and each.end_ns is not None:
        lasted = (each.end_ns - each.start_ns) / SECOND_NS
    return each.patrol, each.name or None, each.actor or None, each.start_ns, each.end_ns, lasted


def _as_text(value: Any) -> str | None:
    """Return a value as JSON would have it, without quotes; NaN is None."""
    if value is None or value != value:  # noqa: PLR0124 - NaN
        return None
    return value.name if isinstance(value, DoorState) else str(value)
