"""In which order to patrol a log's rooms, where to go next, and what to do at a shut door.

    import semmap_log as sl
    from semmap_log.analysis.planning import door_trip, patrol_plan

    log = sl.read("clinic_week")
    plan = patrol_plan(log, start_at="25,-8,L1", rooms=["3", "4", "22"])
    print([stop.door.label for stop in plan.stops])

The guide *Plan a patrol* describes the rules.
"""

from semmap_log.analysis.planning.door_chances import SkipRule
from semmap_log.analysis.planning.door_trip import DoorTrip, TripStop, door_trip
from semmap_log.analysis.planning.followed_round import FollowedRound, RoundStep
from semmap_log.analysis.planning.patrol_plan import (
    NotVisited,
    PatrolOptions,
    PatrolPlan,
    PlannedStop,
    WantedTarget,
)
from semmap_log.analysis.planning.patrol_round import PatrolRound, PatrolTarget, PlannedTry
from semmap_log.analysis.planning.round_planner import BegunRound, begun_round, patrol_plan
from semmap_log.analysis.planning.round_task import AtShutDoor, RoundTask, ShutDoorChoice

__all__ = [
    "AtShutDoor",
    "BegunRound",
    "DoorTrip",
    "FollowedRound",
    "NotVisited",
    "PatrolOptions",
    "PatrolPlan",
    "PatrolRound",
    "PatrolTarget",
    "PlannedStop",
    "PlannedTry",
    "RoundStep",
    "RoundTask",
    "ShutDoorChoice",
    "SkipRule",
    "TripStop",
    "WantedTarget",
    "begun_round",
    "door_trip",
    "patrol_plan",
]
