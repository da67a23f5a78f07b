"""A log's patrol: in which order to visit rooms or doors, what to expect there, and why."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, TypedDict

from semmap_log.analysis.planning.asked_beliefs import beliefs_at
from semmap_log.analysis.planning.last_pose import LastPoseProjection
from semmap_log.analysis.planning.named_places import NamedPlaces
from semmap_log.analysis.planning.passing import PassingProjection
from semmap_log.analysis.planning.patrol_plan import PatrolOptions, PatrolPlan, check_options
from semmap_log.analysis.planning.patrol_targets import all_wanted, wanted_by_name
from semmap_log.analysis.planning.round_planner import AskedRound, BegunRound, RoundPlanner
from semmap_log.analysis.planning.ways_between import WaysBetween
from semmap_log.analysis.rooms import Place, room_plan
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.keywords import knows_keywords, share_keywords
from semmap_log.core.model.moments import Moment
from semmap_log.log.door_log.door_log import DoorLog, Time

if TYPE_CHECKING:
    from typing_extensions import Unpack


class RoundWish(TypedDict, total=False):
    """The keywords of `patrol_plan`, which says what each is; `begun_round` takes them, too."""

    start_at: str | None
    rooms: Sequence[str]
    doors: Sequence[str]
    start: Time
    estimator: str | None
    tz: str | None
    options: PatrolOptions
    progress: Progress | None


_USUAL: Final[RoundWish] = {
    "start_at": None,
    "rooms": (),
    "doors": (),
    "start": None,
    "estimator": None,
    "tz": None,
    "options": PatrolOptions(),
    "progress": None,
}
share_keywords(RoundWish, _USUAL)


@knows_keywords
def patrol_plan(log: DoorLog, **wish: Unpack[RoundWish]) -> PatrolPlan:
    """Return in which order to visit rooms and doors, so that the mean time to visit is least.

    Args:
        log: Whose building.
        start_at: Where the robot starts: `X,Y`, `X,Y,LEVEL`, a room, or a door; None: where the
            log saw it last.
        rooms: Numbers or names of rooms to visit.
        doors: Ids or names of doors to go through; without either: all rooms.
        start: When; None: at the log's end. Of an earlier time counts only what had happened by
            then.
        estimator: None: `filter` up to a day after the log's end, `schedule` beyond.
        tz: IANA zone of the building's clocks; None: the log's.
        options: What a round is like.
        progress: Told how far the reading is.

    Raises:
        PlanError: There is nothing to visit, no such place, no time, or no way.
        UnknownDoorError: There is no such door.
        EstimatorError: There is no such estimator.
        MomentError: The time or the zone cannot be read.
    """
    return begun_round(log, **wish).plan


@knows_keywords
def begun_round(log: DoorLog, **wish: Unpack[RoundWish]) -> BegunRound:
    """Return the same with what it takes to go on with it: see `FollowedRound`.

    Args:
        log: Whose building.
        **wish: The keywords of `patrol_plan`.

    Raises:
        PlanError: There is nothing to visit, no such place, no time, or no way.
        UnknownDoorError: There is no such door.
        EstimatorError: There is no such estimator.
        MomentError: The time or the zone cannot be read.
    """
    given = _USUAL | wish
    options = given["options"]
    check_options(options)
    query, start_ns = beliefs_at(
        log, given["start"], estimator=given["estimator"], tz=given["tz"],
        progress=given["progress"],
    )  # fmt: skip
    at = None if start_ns > query.known_ns else Moment(ns=start_ns)
    ways = WaysBetween(room_plan(log, at=at), speed_m_s=options.speed_m_s)
    names = NamedPlaces(log, ways, at)
    where = _start_place(log, names, given["start_at"], at)
    if given["rooms"] or given["doors"]:
        wanted = wanted_by_name(ways, names, given["rooms"], given["doors"], where)
    else:
        wanted = all_wanted(ways, where)
    passing = None
    if options.asks:
        passing = log.fold(PassingProjection(query.estimator, query.clock.tz), at)
    return RoundPlanner(AskedRound(query, start_ns, passing), ways, options, where).begun(wanted)


def _start_place(
    log: DoorLog, names: NamedPlaces, start_at: str | None, at: Moment | None
) -> Place | None:
    if start_at is not None:
        return names.place(start_at, "--from")
    last = log.fold(LastPoseProjection(), at)
    if last is None or _was_mapped_anew(log, last[1].level, last[0], at):
        return None
    return last[1]


def _was_mapped_anew(log: DoorLog, level: int, since_ns: int, at: Moment | None) -> bool:
    """Tell whether a level got another floor map since: places of before are none on it."""
    since = Moment(ns=max(since_ns, log.horizon_ns()))
    then, now = (log.replay(at=moment).levels.get(level) for moment in (since, at))
    known = None if then is None else then.floor_map_event
    return known is not None and now is not None and now.floor_map_event != known
