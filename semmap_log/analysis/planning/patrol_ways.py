"""Which ways the robot takes from stop to stop of a planned patrol."""

from __future__ import annotations

from itertools import pairwise

from semmap_log.analysis.planning.patrol_plan import PatrolPlan
from semmap_log.analysis.planning.ways_between import WaysBetween
from semmap_log.analysis.rooms import Place


def patrol_ways(plan: PatrolPlan, ways: WaysBetween) -> list[list[Place]]:
    """Return the corners of each way: to the first stop, if the start is known, and then on.

    Args:
        plan: The round; its times are those of these ways.
        ways: In the building, as it was at the round's start.
    """
    start = [] if plan.start is None else [plan.start]
    places = [*start, *(stop.place for stop in plan.stops)]
    return [ways.way(here, there, plan.avoided) for here, there in pairwise(places)]
