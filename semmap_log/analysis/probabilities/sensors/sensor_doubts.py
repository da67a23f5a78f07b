"""Whether what sensors read can be true of the accuracies that were declared for them.

Each source of knowledge is used in the one direction in which doors cannot feign it:

- *Neighbours*: between two visits that read closed, a door reads open at least as often as its
  sensor errs there, 1 - accuracy_closed, whatever the door does. Less often: the sensor is better
  than declared. The same of open.
- *Repeats*: of three readings of one visit the middle one differs from both others as often as the
  sensor errs. More often, also in the quietest third of those hours at which doors stay as they
  are: it is worse than declared. A door that moves while it is looked at is no reason, nor is one
  door alone. Readings that err together differ less often, which is no reason either.
- *Passages*: who goes through has an open door. Readings within a few seconds that say closed more
  often than the sensor may err: it is worse.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.evidence import Evidence
from semmap_log.analysis.probabilities.evidence.visits import (
    LEAST_ACCURACY,
    MOST_ACCURACY,
    Rows,
    Sensor,
)
from semmap_log.analysis.probabilities.sensors import sensor_shares
from semmap_log.analysis.probabilities.sensors.sensor_visits import SensorVisits, Triples
from semmap_log.core.batches.event_batch import distinct, placed
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorPassed

Reals = NDArray[np.float64]

MOST_READINGS = 100_000
"""Only so many of the latest readings count: a sensor is judged by its present state."""
LEAST_OFF = 0.02
"""A sensor that changes no door's P(open) by so much is not reported."""


@dataclass(frozen=True, slots=True)
class SensorDoubt:
    """A sensor whose readings cannot be those of one with the accuracies declared for it."""

    sensor: Sensor
    """As it was declared."""
    when_open: sensor_shares.Seen
    when_closed: sensor_shares.Seen
    readings: int
    doors: int
    p_open_off: float
    """How much higher P(open) would be with what was seen, at the door where that is most."""
    too_sure: float
    """How much more certain one reading makes than by the evidence; 0: not at all."""
    door_id: DoorId
    """The door of `p_open_off`."""
    door: str = ""
    """What it is called."""

    def __str__(self) -> str:
        named = f"sensor {self.sensor.source!r}" if self.sensor.source else "sensor without a name"
        told = [
            f"{right:.3g} declared, {seen.accuracy:.2f} ({seen.low:.2f} to {seen.high:.2f}) seen "
            f"when {state} (by {seen.how})"
            for right, seen, state in (
                (self.sensor.accuracy_open, self.when_open, "open"),
                (self.sensor.accuracy_closed, self.when_closed, "closed"),
            )
            if seen.how
        ]
        way = "low" if self.p_open_off > 0 else "high"
        sure = f", and {self.too_sure:.2f} too sure after a reading" if self.too_sure else ""
        return (
            f"{named}: its accuracy is not what is declared: {'; '.join(told)}. P(open) may be "
            f"{abs(self.p_open_off):.2f} too {way} ({self.door or f'door {self.door_id}'}){sure}"
        )


def sensor_doubts(
    evidence: Evidence, door_ids: Iterable[DoorId], until_ns: int
) -> list[SensorDoubt]:
    """Return the sensors whose declared accuracies the evidence contradicts beyond doubt.

    Args:
        evidence: Of the log.
        door_ids: The queried doors.
        until_ns: What comes after does not count.
    """
    rows, sensors = evidence.readings(door_ids, until_ns, most=MOST_READINGS)
    is_passage = rows["kind"] == DoorPassed.kind
    passages, rows = rows[is_passage], rows[~is_passage]
    kinds: dict[tuple[str, float, float], list[int]] = {}
    for code, (right_open, right_closed, source) in enumerate(sensors):
        key = (source, round(right_open, 2), round(right_closed, 2))
        kinds.setdefault(key, []).append(code)
    found = []
    for codes in kinds.values():
        of_kind = rows[np.isin(rows["sensor"], codes)] if len(kinds) > 1 else rows
        if len(of_kind) >= sensor_shares.FEWEST:
            doubt = _doubt_of(of_kind, sensors[codes[0]], passages)
            found += [] if doubt is None else [doubt]
    return found


def _doubt_of(rows: Rows, sensor: Sensor, passages: Rows) -> SensorDoubt | None:
    """Return the doubt about one sensor's declared accuracies; None: there is none.

    Args:
        rows: Its readings, by door, in order.
        sensor: As declared.
        passages: Who went through which door when.
    """
    visits = SensorVisits.of(rows)
    right = np.clip(sensor[:2], LEAST_ACCURACY, MOST_ACCURACY)
    seen = []
    for state, (here, other) in enumerate((right, right[::-1])):
        is_open = state == 0
        candidates = [
            sensor_shares.by_passages(rows, passages, here) if is_open else None,
            sensor_shares.by_repeats(Triples.of(rows, visits, is_open=is_open), here, other),
            sensor_shares.by_neighbours(visits, here, is_open=is_open),
        ]
        known = [one for one in candidates if one is not None]
        seen.append(known[0] if known else sensor_shares.Seen(here, here, here, ""))
    if not any(one.how for one in seen):
        return None
    found = np.array([one.accuracy for one in seen])
    off, door_id = _off(visits, right, found)
    too_sure = max(0.0, float((_trust(right) - _trust(found)).max()))
    if max(abs(off), too_sure) < LEAST_OFF:
        return None
    doors = len(distinct(rows["door_id"]))
    return SensorDoubt(sensor, seen[0], seen[1], len(rows), doors, off, too_sure, door_id)


def _off(visits: SensorVisits, declared: Reals, seen: Reals) -> tuple[float, DoorId]:
    """Return by how much a door's share open differs, at the door where that is most."""
    doors, door = placed(visits.door_id)
    share = np.bincount(door, visits.share) / np.bincount(door)
    off = _corrected(share, seen) - _corrected(share, declared)
    most = int(np.argmax(np.abs(off)))
    return float(off[most]), DoorId(int(doors[most]))


def _trust(right: Reals) -> Reals:
    """Return P(open | reads open) and P(closed | reads closed) of a door that may be either."""
    found: Reals = right / (right + 1 - right[::-1])
    return found


def _corrected(share: Reals, right: Reals) -> Reals:
    """Return how often doors are open that are read open so often (Rogan and Gladen)."""
    a, b = right
    found: Reals = np.clip((share - (1 - b)) / max(a + b - 1, 1e-9), 0.0, 1.0)
    return found
