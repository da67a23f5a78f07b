"""What was learnt of doors, as the chances of a round."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.planning.door_chances import DoorChances
from semmap_log.analysis.planning.looks_then import looks_then
from semmap_log.analysis.probabilities.belief_fold import Beliefs
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.moments import SECOND_NS

STEP_S = 300.0
"""Between two times at which P is asked for."""
LONGEST_S = 12 * 3600.0
"""Of a round: from then on P stays as it is."""


def round_times_s(longest_s: float) -> NDArray[np.float64]:
    """Return the times of a round at which P is asked for, from its start on, seconds."""
    count = math.ceil(min(longest_s, LONGEST_S) / STEP_S) + 1
    return np.arange(count, dtype=np.float64) * STEP_S


def learnt_chances(
    beliefs: Beliefs,
    doors: Sequence[DoorId],
    *,
    known_ns: int,
    start_ns: int,
    times_s: NDArray[np.float64],
    others: NDArray[np.float64] | None = None,
) -> DoorChances:
    """Return how likely doors are so, at times of a round, by what was known at a moment.

    Args:
        beliefs: Of P(open), or P(passes).
        doors: Which.
        known_ns: What happened later does not count.
        start_ns: Of the round.
        times_s: (k,): of the round, `STEP_S` apart.
        others: See `DoorChances.with_stand_ins`.
    """
    times_ns = start_ns + np.round(times_s * SECOND_NS).astype(np.int64)
    known = np.full(len(times_ns), known_ns)
    said = [beliefs.predict(door, times_ns, known) for door in doors]
    looks = [
        looks_then(
            beliefs.evidence.door(door, known_ns), beliefs.clock,
            time_ns=start_ns, known_ns=known_ns,
        )
        for door in doors
    ]  # fmt: skip
    shape = (len(doors), len(times_ns))
    return DoorChances(
        p_passes=np.array([each.p_open for each in said]).reshape(shape),
        low=np.array([each.low for each in said]).reshape(shape),
        high=np.array([each.high for each in said]).reshape(shape),
        is_known=np.array([each.is_known.all() for each in said], np.bool_),
        looks=np.array(looks, np.int64).reshape(-1, 2),
        looks_high=np.array([each.high for each in looks]),
        unseen_s=np.array(unseen_s(beliefs, doors, known_ns=known_ns, start_ns=start_ns)),
        step_s=STEP_S,
    ).with_stand_ins(others)


def unseen_s(
    beliefs: Beliefs, doors: Sequence[DoorId], *, known_ns: int, start_ns: int
) -> list[float]:
    """Return for how long nobody has looked at doors when a round begins; inf: nobody ever did."""
    seen_ns = [beliefs.evidence.counts(door, known_ns).last_seen_ns for door in doors]
    return [math.inf if at is None else (start_ns - at) / SECOND_NS for at in seen_ns]
