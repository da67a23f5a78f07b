"""Why a stop is where it is, and why another is none, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from semmap_log.analysis.planning.door_chances import DoorChances, SkipRule
from semmap_log.analysis.planning.patrol_round import EXPECTED_P, PlannedTry

CHANGES_BY = 0.15
"""P at arrival is told beside that at the start where they differ by so much."""
HOUR_S = 3600.0


def why_then(chances: DoorChances, row: int, planned: PlannedTry, skip: SkipRule) -> str:
    """Return why a door is tried then."""
    if skip.seem_shut(chances)[row]:
        return f"seems shut, {unseen_in_words(float(chances.unseen_s[row]))}: looked at again"
    if not chances.is_known[row]:
        return "UNKNOWN: too little seen of it"
    now = float(chances.p_passes[row, 0])
    if abs(planned.p_passes - now) >= CHANGES_BY:
        turns = "opens" if planned.p_passes > now else "closes"
        return f"{turns} about then: {now:.2f} at the start"
    return "likely open" if planned.p_passes >= EXPECTED_P else "more likely shut: worth a try"


def shut_in_words(chances: DoorChances, rows: Sequence[int]) -> str:
    """Return why a target is left out all whose doors seem shut."""
    looks, found_open = (int(each) for each in chances.looks[list(rows)].sum(axis=0))
    high = max(float(chances.looks_high[row]) for row in rows)
    unseen = unseen_in_words(max(float(chances.unseen_s[row]) for row in rows))
    at_looks = f"at {looks - found_open} of {looks} looks at such hours"
    return f"shut {at_looks}, open at most {high:.2f} of the time; {unseen}"


def unseen_in_words(seconds: float) -> str:
    """Return how long nobody has looked at a door."""
    if not math.isfinite(seconds):
        return "never looked at"
    if seconds < HOUR_S:
        return f"looked at {seconds / 60:.0f} min before"
    return f"looked at {seconds / HOUR_S:.0f} h before"
