"""How likely a log's doors are open: queried, written to the map, and evaluated.

    import semmap_log as sl
    from semmap_log.analysis.beliefs import probabilities

    for one in probabilities(sl.read("clinic_week"), horizon_ns=2 * 3600 * 10**9):
        print(one.door.name, one.p_open, one.low, one.high)

Names are loaded when they are first used.
"""

# The arithmetic is in `probabilities`, which knows evidence and time, and no log.

from __future__ import annotations

from typing import TYPE_CHECKING

from semmap_log.core.lazily import lazy_names

if TYPE_CHECKING:
    from semmap_log.analysis.beliefs.applying import Applied, apply_probabilities
    from semmap_log.analysis.beliefs.best_times import BestTime, best_time
    from semmap_log.analysis.beliefs.door_beliefs import (
        DoorBelief,
        DoorBeliefs,
        TypicalWeek,
        probabilities,
        typical_weeks,
    )
    from semmap_log.analysis.beliefs.evaluation import Evaluation, evaluate
    from semmap_log.analysis.beliefs.explaining import explain
    from semmap_log.analysis.beliefs.sensor_calibration import Calibration, calibrate
    from semmap_log.analysis.probabilities.belief_fold import BeliefProjection, Beliefs, by_name
    from semmap_log.core.folds.explanation import Explanation, NextChange, StateReason

__all__ = [
    "Applied",
    "BeliefProjection",
    "Beliefs",
    "BestTime",
    "Calibration",
    "DoorBelief",
    "DoorBeliefs",
    "Evaluation",
    "Explanation",
    "NextChange",
    "StateReason",
    "TypicalWeek",
    "apply_probabilities",
    "best_time",
    "by_name",
    "calibrate",
    "evaluate",
    "explain",
    "probabilities",
    "typical_weeks",
]

_HOMES = {
    "analysis.beliefs.applying": (
        "Applied",
        "apply_probabilities",
    ),
    "analysis.beliefs.door_beliefs": (
        "DoorBelief",
        "DoorBeliefs",
        "probabilities",
        "TypicalWeek",
        "typical_weeks",
    ),
    "analysis.beliefs.best_times": (
        "BestTime",
        "best_time",
    ),
    "analysis.beliefs.sensor_calibration": (
        "Calibration",
        "calibrate",
    ),
    "analysis.beliefs.evaluation": (
        "Evaluation",
        "evaluate",
    ),
    "analysis.beliefs.explaining": ("explain",),
    "core.folds.explanation": (
        "Explanation",
        "NextChange",
        "StateReason",
    ),
    "analysis.probabilities.belief_fold": (
        "BeliefProjection",
        "Beliefs",
        "by_name",
    ),
}

__getattr__ = lazy_names(__name__, _HOMES)


def __dir__() -> list[str]:
    return __all__
