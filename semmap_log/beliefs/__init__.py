"""How likely a log's doors are open: asked, applied to the map, and judged.

    import semmap_log as sl
    from semmap_log.beliefs import probabilities

    for one in probabilities(sl.read("clinic_week"), horizon_ns=2 * 3600 * 10**9):
        print(one.door.name, one.p_open, one.low, one.high)

Names are loaded when they are first used.
"""

# The arithmetic is in `probabilities`, which knows evidence and time, and no log.

from __future__ import annotations

from typing import TYPE_CHECKING

from semmap_log.common.lazily import lazy_names

if TYPE_CHECKING:
    from semmap_log.beliefs.applying import Applied, apply_probabilities
    from semmap_log.beliefs.best_times import BestTime, best_time
    from semmap_log.beliefs.door_beliefs import DoorBelief, DoorBeliefs, probabilities
    from semmap_log.beliefs.evaluation import Evaluation, evaluate
    from semmap_log.beliefs.sensor_calibration import Calibration, calibrate
    from semmap_log.beliefs.typical_week import TypicalWeek, typical_weeks
    from semmap_log.probabilities.belief_fold import BeliefProjection, Beliefs
    from semmap_log.probabilities.estimators import by_name

__all__ = [
    "Applied",
    "BeliefProjection",
    "Beliefs",
    "BestTime",
    "Calibration",
    "DoorBelief",
    "DoorBeliefs",
    "Evaluation",
    "TypicalWeek",
    "apply_probabilities",
    "best_time",
    "by_name",
    "calibrate",
    "evaluate",
    "probabilities",
    "typical_weeks",
]

_HOMES = {
    "beliefs.applying": ("Applied", "apply_probabilities"),
    "beliefs.door_beliefs": ("DoorBelief", "DoorBeliefs", "probabilities"),
    "beliefs.best_times": ("BestTime", "best_time"),
    "beliefs.sensor_calibration": ("Calibration", "calibrate"),
    "beliefs.evaluation": ("Evaluation", "evaluate"),
    "beliefs.typical_week": ("TypicalWeek", "typical_weeks"),
    "probabilities.belief_fold": ("BeliefProjection", "Beliefs"),
    "probabilities.estimators": ("by_name",),
}

__getattr__ = lazy_names(__name__, _HOMES)


def __dir__() -> list[str]:
    return __all__
