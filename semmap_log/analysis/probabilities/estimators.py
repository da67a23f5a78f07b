"""The estimators by the names that the command line knows them by."""

from __future__ import annotations

import re

from semmap_log.analysis.probabilities.estimator import Estimator
from semmap_log.analysis.probabilities.methods.baselines import CONSTANT, HOUR_OF_DAY, HOUR_OF_WEEK
from semmap_log.analysis.probabilities.methods.count import Count
from semmap_log.analysis.probabilities.methods.filter import Filter
from semmap_log.analysis.probabilities.methods.fremen import PERIODS_S, Fremen
from semmap_log.analysis.probabilities.methods.last import Last
from semmap_log.analysis.probabilities.methods.schedule import Schedule
from semmap_log.errors import EstimatorError

ESTIMATORS: dict[str, Estimator] = {
    one.name: one
    for one in (
        Filter(),
        Schedule(),
        Count(),
        Last(),
        Fremen(),
        CONSTANT,
        HOUR_OF_DAY,
        HOUR_OF_WEEK,
    )
}
"""Name -> estimator, with the settings that it has by default."""


def by_name(name: str) -> Estimator:
    """Return the estimator of that name; FreMEn of any order: fremen1..fremen84.

    Raises:
        EstimatorError: There is none.
    """
    if name in ESTIMATORS:
        return ESTIMATORS[name]
    fremen = re.fullmatch(r"fremen(\d{1,2})", name, re.ASCII)
    if fremen and 1 <= int(fremen[1]) <= len(PERIODS_S):
        return Fremen(int(fremen[1]))
    known = ", ".join(ESTIMATORS)
    raise EstimatorError(
        f"estimator {name!r}: expected one of {known}, fremen1..fremen{len(PERIODS_S)}."
    )
