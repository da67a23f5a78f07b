"""The doors at a moment, and what is believed of them, as rows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from semmap_log.analysis.beliefs import probabilities
from semmap_log.analysis.beliefs.door_beliefs import DoorBelief
from semmap_log.analysis.sql.made_tables import made_table, query_schema
from semmap_log.analysis.sql.view_columns import ANNOTATIONS, BELIEFS, DOORS
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.model.doors import Door, DoorMap, DoorState
from semmap_log.core.model.meaning import FIELDS
from semmap_log.core.model.moments import parse_duration
from semmap_log.log.door_log.door_log import DoorLog, Time

TEXTS = pa.map_(pa.string(), pa.string())

DOOR_SCHEMA = query_schema(DOORS, pa.field(ANNOTATIONS.name, TEXTS))
BELIEF_SCHEMA = query_schema(BELIEFS)


def door_table(door_map: DoorMap) -> pa.Table:
    """Return the doors of a map, ids ascending, by `DOOR_SCHEMA`."""
    doors = list(door_map.doors.values())
    table = made_table(DOORS, [tuple(_door_row(door, door_map)) for door in doors])
    said = pa.array([list(door.annotations.items()) for door in doors], TEXTS)
    return table.append_column(ANNOTATIONS.name, said).cast(DOOR_SCHEMA, safe=False)


def belief_table(log: DoorLog, at: Time, horizon: str | None = None) -> pa.Table:
    """Return how likely each door is open, by `BELIEF_SCHEMA`.

    Args:
        log: Whose doors.
        at: The moment asked from.
        horizon: How long after it, such as `2h`.

    Raises:
        MomentError: One of the two cannot be read.
    """
    horizon_ns = 0 if horizon is None else parse_duration(horizon)
    found = probabilities(log, at=at, horizon_ns=horizon_ns)
    return made_table(BELIEFS, [_belief_row(one) for one in found]).cast(BELIEF_SCHEMA, safe=False)


def _door_row(door: Door, door_map: DoorMap) -> Iterator[Any]:
    yield from (door.door_id, door.name, door_map.level_name(door.level))
    for name in FIELDS:
        value = getattr(door, name)
        yield value.name if isinstance(value, DoorState) else value
    yield from (door.last_seen_ns, door.last_event)


def _belief_row(one: DoorBelief) -> tuple[Any, ...]:
    counts = one.evidence.counts
    return (
        one.door.door_id, one.door.name, one.level_name, one.known_ns, one.time_ns,
        one.p_open, one.low, one.high, one.p_closed, one.is_known,
        one.estimator, counts.sightings, counts.visits, counts.last_seen_ns,
    )  # fmt: skip
