"""The methods by name."""

from __future__ import annotations

import re

from semmap_log.errors import EvaluationError
from semmap_log.probabilities.baselines import CONSTANT, HOUR_OF_DAY, HOUR_OF_WEEK
from semmap_log.probabilities.estimator import Estimator
from semmap_log.probabilities.fremen import PERIODS_S, Fremen

_METHODS: dict[str, Estimator] = {
    method.name: method for method in (Fremen(5), CONSTANT, HOUR_OF_DAY, HOUR_OF_WEEK)
}
NAMES = tuple(_METHODS)
"""What `by_name` knows, beside FreMEn of other orders."""


def by_name(name: str) -> Estimator:
    """Return the method of that name.

    Raises:
        EvaluationError: There is none.
    """
    if name in _METHODS:
        return _METHODS[name]
    fremen = re.fullmatch(r"fremen(\d{1,2})", name, re.ASCII)
    if fremen and 1 <= int(fremen[1]) <= len(PERIODS_S):
        return Fremen(int(fremen[1]))
    known = ", ".join(NAMES)
    raise EvaluationError(f"no estimator {name!r}: expected one of {known}, fremen1..fremen84.")
