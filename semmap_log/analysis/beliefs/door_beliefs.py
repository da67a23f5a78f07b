"""How likely each door is open at a moment, how sure that is, and on what evidence."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from semmap_log.analysis.beliefs.belief_query import BeliefQuery, ask
from semmap_log.analysis.beliefs.evidence_summary import EvidenceSummary
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.io.progress import Progress
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.doors import Door, DoorId
from semmap_log.core.model.keywords import knows_keywords
from semmap_log.core.model.moments import HOUR_NS
from semmap_log.core.model.shown_as_table import ShownAsTable
from semmap_log.errors import MomentError
from semmap_log.log.door_log.door_log import DoorLog, Time

if TYPE_CHECKING:
    from semmap_log.analysis.probabilities.sensors.sensor_doubts import SensorDoubt

NEAR_NS = 24 * HOUR_NS
"""So far ahead the last sightings still tell something; beyond, only habits do."""

NOW, LATER = "filter", "schedule"


def default_estimator(horizon_ns: int = 0) -> str:
    """Return the name of the estimator that is taken for a time so far ahead."""
    return NOW if horizon_ns <= NEAR_NS else LATER


@dataclass(frozen=True, slots=True, repr=False)
class DoorBelief(ShownAsTable):
    """How likely a door is open at a moment."""

    door: Door
    """As it was known then."""
    level_name: str
    known_ns: int
    """Up to when evidence counts."""
    time_ns: int
    """The moment that the probability is of: `known_ns` and the horizon."""
    estimator: str
    p_open: float
    low: float
    """Of the 90 % interval of P(open)."""
    high: float
    is_known: bool
    """False: the evidence is below what it takes, and the numbers are what doors are like of
    which nothing is known."""
    evidence: EvidenceSummary

    def __repr__(self) -> str:
        said = f"P(open) {self.p_open:.2f}, {self.low:.2f} to {self.high:.2f}"
        return f"<DoorBelief of {self.door.label!r}: {said if self.is_known else 'not known'}>"

    @property
    def p_closed(self) -> float:
        """1 - P(open)."""
        return 1.0 - self.p_open


class DoorBeliefs(list[DoorBelief], ShownAsTable):
    """Beliefs of one moment, ids ascending."""

    def __init__(
        self, beliefs: Iterable[DoorBelief], *, tz: str, sensor_doubts: Sequence[SensorDoubt] = ()
    ) -> None:
        """Take beliefs.

        Args:
            beliefs: One a door.
            tz: IANA zone of the building's clocks.
            sensor_doubts: Sensors that are not as accurate as declared: the beliefs are off.
        """
        super().__init__(beliefs)
        self.tz = tz
        self.sensor_doubts = sensor_doubts


@knows_keywords
def probabilities(
    log: DoorLog,
    *,
    at: Time = None,
    known_at: Time = None,
    as_happened: bool = False,
    horizon_ns: int = 0,
    estimator: str | None = None,
    tz: str | None = None,
    doors: Iterable[DoorId | str] | None = None,
    progress: Progress | None = None,
) -> DoorBeliefs:
    """Return how likely each door is open, ids ascending.

    Args:
        log: Whose doors.
        at: The moment asked from, with all that is known today of what had happened by then.
        known_at: Only what had been recorded by then, whole commits; without `at` it is the moment,
            too. Without either that is the log's end.
        as_happened: As if each event had been recorded when it happened, whatever was imported or
            told later: see `belief_query.ask`.
        horizon_ns: How long after it.
        estimator: None: `filter` up to a day ahead, `schedule` beyond.
        tz: IANA zone of the building's clocks; None: the log's.
        doors: Only these (id, name, or level/name); None: all that are in the map then.
        progress: Told how far the reading is.

    Raises:
        UnknownDoorError: One of the doors was not in the map then.
        EstimatorError: There is no such estimator.
        MomentError: The time or the zone cannot be read, or the horizon leads beyond 2262.
    """
    chosen = estimator or default_estimator(horizon_ns)
    asked = ask(
        log, at=at, known_at=known_at, as_happened=as_happened, estimator=chosen, tz=tz,
        doors=doors, progress=progress,
    )  # fmt: skip
    if not 0 <= asked.known_ns + horizon_ns <= MAX_TIME_NS:
        days = horizon_ns / (24 * HOUR_NS)
        raise MomentError(f"horizon: expected one that ends before 2262, got {days:g} days.")
    told = (belief(asked, door, horizon_ns) for door in asked.doors)
    return DoorBeliefs(told, tz=tz or log.info.timezone, sensor_doubts=asked.sensor_doubts(log))


def belief(asked: BeliefQuery, door: Door, horizon_ns: int = 0) -> DoorBelief:
    """Return what is believed of one door, so long after the moment that is asked from."""
    time_ns = asked.known_ns + horizon_ns
    said = asked.predict(door, np.array([time_ns]))
    return DoorBelief(
        door=door,
        level_name=asked.door_map.level_name(door.level),
        known_ns=asked.known_ns,
        time_ns=time_ns,
        estimator=asked.estimator,
        p_open=float(said.p_open[0]),
        low=float(said.low[0]),
        high=float(said.high[0]),
        is_known=bool(said.is_known[0]),
        evidence=asked.evidence(door),
    )
