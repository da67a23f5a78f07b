"""Which events of a batch can be wrong, and so must be looked at one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.distinct import distinct
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.messages import OBJECT_KINDS
from semmap_log.core.model.doors import is_given
from semmap_log.core.model.events import (
    KINDS,
    NO_LEVEL,
    DoorAdded,
    DoorEvent,
    DoorRemoved,
    DoorUpdated,
    Event,
    FloorMap,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    RobotPose,
)
from semmap_log.core.model.meaning import PLACING, Changed, Presence
from semmap_log.log.door_log.door_index import DoorIndex

_ROWS: tuple[type[DoorEvent], ...] = tuple(
    kind for kind in KINDS if issubclass(kind, DoorEvent) and kind.kind not in OBJECT_KINDS
)
"""Kinds about a door that a batch holds as columns."""

SIGHTINGS = tuple(
    kind
    for kind in _ROWS
    if kind.effect.presence is Presence.STAYS and not kind.effect.can_set & ~Changed.STATE
)
"""Kinds that can be said of every door in the map, and change neither doors nor names."""

HARMLESS: tuple[type[Event], ...] = (*SIGHTINGS, PatrolStarted, PatrolFinished, RobotPose)
"""Those, and the kinds that are about no door: nothing of a batch of them can be wrong."""

ON_A_LEVEL = (DoorAdded, DoorUpdated, RobotPose, FloorMap)
"""Kinds that may leave it to the log which level they mean."""

FEW_ROWS = 256


def rows_to_check(batch: EventBatch, index: DoorIndex) -> NDArray[np.bool_] | None:
    """Return which events `Validator.check` must see; the others it lets pass whatever they say.

    None stands for none. Those are the kinds that change the index, and what is about doors that
    are not in the map or that the batch takes out of it.

    Args:
        batch: Events that tell their levels.
        index: The doors and levels before it.
    """
    kinds = kinds_of(batch)
    about = [batch[kind] for kind in kinds if issubclass(kind, DoorEvent) and kind in _ROWS]
    doors = set().union(*(_distinct(rows["door_id"]) for rows in about))
    is_known = doors <= index.placed.keys()
    if is_known and all(kind in HARMLESS for kind in kinds):
        return None
    ids = batch.door_ids()
    harmless = np.isin(batch.kind, [kind.kind for kind in HARMLESS])
    if DoorUpdated in batch:
        placing = batch[DoorUpdated]["changed"] & int(PLACING) != 0
        harmless[batch.where(DoorUpdated)] = ~placing
    if not is_known:
        harmless &= ~np.isin(ids, list(doors - index.placed.keys()))
    if DoorRemoved in batch:
        harmless &= ~np.isin(ids, batch[DoorRemoved]["door_id"])
    if Retracted in batch:
        for first, last in batch[Retracted][["first_event", "last_event"]].tolist():
            harmless &= ~np.isin(ids, index.added_by(first, last))
    return ~harmless


def with_levels(batch: EventBatch, level: int) -> EventBatch:
    """Return poses, and what else makes no level, with the one that the poses did not tell."""
    poses = batch[RobotPose].copy()
    poses["level"][poses["level"] == NO_LEVEL] = level
    return replace(batch, columns={**batch.columns, RobotPose.kind: poses})


def kinds_of(batch: EventBatch) -> list[type[Event]]:
    """Return the kinds of a batch."""
    return [KINDS[kind - 1] for kind in (*batch.columns, *batch.objects)]


def lacks_levels(batch: EventBatch) -> bool:
    """Tell whether some of the events leave it to the log which level they mean."""
    columns = (batch.columns[kind.kind] for kind in ON_A_LEVEL if kind.kind in batch.columns)
    if any((rows["level"] == NO_LEVEL).any() for rows in columns):
        return True
    maps = batch.objects.get(FloorMap.kind, ())
    return any(isinstance(event, FloorMap) and not is_given(event.level) for event in maps)


def _distinct(ids: NDArray[np.uint32]) -> set[int]:
    """Return the ids that occur."""
    return set(ids.tolist() if len(ids) <= FEW_ROWS else distinct(ids).tolist())
