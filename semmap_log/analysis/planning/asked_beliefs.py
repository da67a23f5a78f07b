"""What is believed at the moment that a plan starts from."""

from __future__ import annotations

import math

from semmap_log.analysis.beliefs.belief_query import BeliefQuery, ask
from semmap_log.analysis.beliefs.door_beliefs import default_estimator
from semmap_log.analysis.probabilities.estimator import StateModel
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.moments import Moment
from semmap_log.log.door_log.door_log import DoorLog, Time


def beliefs_at(
    log: DoorLog, start: Time, *, estimator: str | None, tz: str | None, progress: Progress | None
) -> tuple[BeliefQuery, int]:
    """Return what is known of all doors, and when the plan starts, ns.

    Before the log's end counts only what had happened by then: one does not foretell the past.

    Args:
        log: Whose doors.
        start: When the plan starts; None: at the log's end.
        estimator: None: as far ahead as that is from the log's end.
        tz: IANA zone; None: the log's.
        progress: Told how far the reading is.

    Raises:
        EstimatorError: There is no such estimator.
        MomentError: The time or the zone cannot be read.
    """
    end_ns = log.end_ns()
    start_ns = end_ns if start is None else log.instant(log.moment(start))
    assert start_ns is not None, "only None means no time"
    at = Moment(ns=start_ns) if start_ns < end_ns else None
    chosen = estimator or default_estimator(max(0, start_ns - end_ns))
    return ask(log, at=at, estimator=chosen, tz=tz, doors=None, progress=progress), start_ns


def wait_s(
    query: BeliefQuery,
    door_id: DoorId,
    at_ns: int,
    *,
    most_s: float | None = None,
    is_shut: bool = False,
) -> float | None:
    """Return the expected wait until a door is open, from then on; None: nobody knows.

    Args:
        query: What is known.
        door_id: The door.
        at_ns: From then on.
        most_s: Who has waited so long goes.
        is_shut: It is found shut then; else it may be open, which is no wait.
    """
    learnt = query.beliefs.learnt(query.known_ns)
    if not isinstance(learnt, StateModel):
        return None
    seconds = learnt.wait_s(
        door_id, at_ns, most_s=most_s, known_ns=query.known_ns, is_other=is_shut
    )
    return seconds if math.isfinite(seconds) else None
