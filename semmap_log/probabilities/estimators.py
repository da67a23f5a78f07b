"""The estimators by the names that the command line knows them by."""

from __future__ import annotations

from semmap_log.errors import EstimatorError
from semmap_log.probabilities.estimator import Estimator
from semmap_log.probabilities.filter import Filter
from semmap_log.probabilities.last import Last
from semmap_log.probabilities.schedule import Schedule

ESTIMATORS: dict[str, Estimator] = {one.name: one for one in (Filter(), Schedule(), Last())}
"""Name -> estimator, with the settings that it has by default."""


def by_name(name: str) -> Estimator:
    """Return the estimator of that name.

    Raises:
        EstimatorError: There is none.
    """
    if name not in ESTIMATORS:
        raise EstimatorError(f"estimator {name!r}: expected one of {', '.join(ESTIMATORS)}.")
    return ESTIMATORS[name]
