"""A log's beliefs: its events, folded into evidence, and an estimator that learns from them."""

from __future__ import annotations

from semmap_log.domain.keywords import knows_keywords
from semmap_log.door_log.door_log import DoorLog, Time
from semmap_log.io.progress import Progress
from semmap_log.probabilities.belief_fold import BeliefProjection, Beliefs
from semmap_log.probabilities.estimator import Estimator


@knows_keywords
def learn(
    log: DoorLog,
    *,
    at: Time = None,
    known_at: Time = None,
    estimator: Estimator | str = "filter",
    tz: str | None = None,
    progress: Progress | None = None,
) -> Beliefs:
    """Return what a log's doors are believed to be.

    Args:
        log: The log.
        at: Only what had happened by then, with all that is known today.
        known_at: Only what had been recorded by then, whole commits.
        estimator: A method, or its name: see `semmap_log.probabilities.estimators`.
        tz: IANA zone of hours and weekdays; None: the log's.
        progress: Told how far the reading is.

    Raises:
        EstimatorError: There is no such estimator.
        MomentError: No such time, or no such zone.
    """
    projection = BeliefProjection(estimator, log.info.timezone if tz is None else tz)
    return log.fold(projection, at, known_at, progress=progress)
