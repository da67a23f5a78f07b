"""Jobs that ask about doors: the map of a moment, openings by hour, how likely they are open."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from semmap_log.analysis.beliefs.door_beliefs import default_estimator, probabilities
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.folds.timeline import Timeline, timelines
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.moments import HOUR_NS
from semmap_log.fleet.jobs.job import TIME, Holds, Told
from semmap_log.log.door_log.door_labels import labels_ever
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.replay.replay import Scope

PART_EVENTS = 1_000_000
"""So many events of a log are held at once: some 60 bytes each while they are put in order."""

DOOR_FIELDS = (
    pa.field("door_id", pa.uint32(), nullable=False),
    pa.field("door", pa.string(), nullable=False),
)


@dataclass(frozen=True, slots=True)
class DoorMapJob:
    """All doors of all logs at a moment."""

    at: str | int | None = None
    known_at: str | int | None = None

    name: ClassVar[str] = "map"
    holds: ClassVar[Holds] = Holds.with_head
    fields: ClassVar[tuple[pa.Field, ...]] = (
        *DOOR_FIELDS,
        pa.field("level", pa.uint16(), nullable=False),
        *(pa.field(name, pa.float64()) for name in ("x", "y", "theta", "width")),
        pa.field("state", pa.string(), nullable=False),
        pa.field("last_seen", TIME),
        pa.field("prob_open", pa.float64()),
        pa.field("prob_closed", pa.float64()),
    )

    def parameters(self) -> str:
        """Return the moment."""
        return f"at={self.at!r} known_at={self.known_at!r}"

    def ask(self, log: DoorLog) -> Told:
        """Return a row a door, ids ascending."""
        doors = list(log.replay(self.at, self.known_at).doors.values())
        rows: dict[str, list[Any]] = {
            "door": [door.label for door in doors],
            "state": [door.state.name for door in doors],
            "last_seen": [door.last_seen_ns for door in doors],
        }
        for name in ("x", "y", "theta", "width", "prob_open", "prob_closed"):
            values = (getattr(door, name) for door in doors)
            rows[name] = [None if math.isnan(value) else value for value in values]
        for name in ("door_id", "level"):
            rows[name] = [getattr(door, name) for door in doors]
        return Told(rows)


@dataclass(frozen=True, slots=True)
class OpeningsJob:
    """How often each door was opened in each hour (UTC) in which it was.

    An opening is the beginning of an interval of a door's timeline in which it is OPEN, where it
    was last known to be CLOSED. So it is a lower bound: what no sensor saw is not told.
    """

    name: ClassVar[str] = "openings"
    holds: ClassVar[Holds] = Holds.with_head
    fields: ClassVar[tuple[pa.Field, ...]] = (
        *DOOR_FIELDS,
        pa.field("hour", TIME, nullable=False),
        pa.field("openings", pa.int64(), nullable=False),
    )

    def parameters(self) -> str:
        """Return that there are none."""
        return ""

    def ask(self, log: DoorLog) -> Told:
        """Return a row a door and hour."""
        return self.ask_part(log, 0, 1, log.last_event())

    def parts(self, events: int) -> int:
        """Return how many parts of the doors are asked apart."""
        return max(1, -(-events // PART_EVENTS))

    def ask_part(self, log: DoorLog, part: int, parts: int, last_event: int) -> Told:
        """Return the rows of the doors whose number leaves the rest `part`."""
        scope = Scope(event=None if last_event < 0 else last_event)
        labels = labels_ever(log.state_in(scope))
        doors = [door for door in labels if door % parts == part] if parts > 1 else None
        found = timelines(log.visible_batches(scope), doors)
        rows: dict[str, list[Any]] = {"door_id": [], "door": [], "hour": [], "openings": []}
        for door_id, timeline in found.items():
            hours, counts = np.unique(openings_ns(timeline) // HOUR_NS, return_counts=True)
            rows["door_id"] += [door_id] * len(hours)
            rows["door"] += [labels.get(door_id, f"door {door_id}")] * len(hours)
            rows["hour"] += (hours * HOUR_NS).tolist()
            rows["openings"] += counts.tolist()
        return Told(rows)

    def joined(self, answers: Sequence[Told]) -> Told:
        """Return the rows of all doors, ids ascending."""
        rows = {name: [v for told in answers for v in told.rows[name]] for name in answers[0].rows}
        order = sorted(
            range(len(rows["hour"])), key=lambda i: (rows["door_id"][i], rows["hour"][i])
        )
        return Told({name: [values[i] for i in order] for name, values in rows.items()})


def openings_ns(timeline: Timeline) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return when a door was opened, nanoseconds UTC: it is OPEN, and was last known CLOSED."""
    known = np.isin(timeline.state, (DoorState.OPEN, DoorState.CLOSED))
    states, start_ns = timeline.state[known], timeline.start_ns[known]
    opens = np.flatnonzero((states[1:] == DoorState.OPEN) & (states[:-1] == DoorState.CLOSED)) + 1
    found: np.ndarray[Any, np.dtype[np.int64]] = start_ns[opens]
    return found


@dataclass(frozen=True, slots=True)
class ProbabilitiesJob:
    """How likely each door of each log is open: see `beliefs.door_beliefs.probabilities`."""

    at: str | int | None = None
    known_at: str | int | None = None
    horizon_ns: int = 0
    estimator: str | None = None

    name: ClassVar[str] = "probabilities"
    holds: ClassVar[Holds] = Holds.with_head
    fields: ClassVar[tuple[pa.Field, ...]] = (
        *DOOR_FIELDS,
        pa.field("time", TIME, nullable=False),
        *(pa.field(name, pa.float64(), nullable=False) for name in ("p_open", "low", "high")),
        pa.field("is_known", pa.bool_(), nullable=False),
        pa.field("estimator", pa.string(), nullable=False),
    )

    def parameters(self) -> str:
        """Return the moment, how far ahead, and by which estimator."""
        name = self.estimator or default_estimator(self.horizon_ns)
        return f"at={self.at!r} known_at={self.known_at!r} {self.horizon_ns} {name}"

    def ask(self, log: DoorLog) -> Told:
        """Return a row a door, ids ascending."""
        found = probabilities(
            log, at=self.at, known_at=self.known_at, horizon_ns=self.horizon_ns,
            estimator=self.estimator,
        )  # fmt: skip
        rows: dict[str, list[Any]] = {
            "door_id": [belief.door.door_id for belief in found],
            "door": [belief.door.label for belief in found],
            "time": [belief.time_ns for belief in found],
        }
        for name in ("p_open", "low", "high", "is_known", "estimator"):
            rows[name] = [getattr(belief, name) for belief in found]
        return Told(rows)
