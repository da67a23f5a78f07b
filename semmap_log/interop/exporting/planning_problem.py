"""A log's doors as a problem for a planner that reads PDDL."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

from semmap_log.analysis.beliefs import probabilities
from semmap_log.core.folds.doors_of_class import only_doors
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import DoorId, DoorMap
from semmap_log.core.model.moments import Moment
from semmap_log.core.texts import counted
from semmap_log.errors import CommandError
from semmap_log.interop.formats.files.pddl import Likely, PddlProblem, Wishes, rooms_between
from semmap_log.log.door_log.door_labels import labels_of
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.replay.replay import Scope

MOST_NAMED = 2
"""So many doors are named in a note."""


@dataclass(frozen=True, slots=True)
class PlanningProblem:
    """The text of a problem, and what to know of it."""

    text: str
    doors: int
    rooms: int
    notes: tuple[str, ...]


def planning_problem(
    log: DoorLog,
    scope: Scope,
    wishes: Wishes,
    about: Mapping[str, str],
    *,
    default_prob: float | None = None,
    progress: Progress | None = None,
) -> PlanningProblem:
    """Return the doors of a moment as a PDDL problem: what they were, and how likely open.

    Args:
        log: Whose doors.
        scope: The moment. How likely a door is open is learnt from what counts then, as
            `probabilities` does it.
        wishes: Start, goal, costs.
        about: What is said of the log.
        default_prob: P(open) of doors of which too little was seen; None: what that little says.
        progress: Told how far the reading is.

    Raises:
        CommandError: There is no such room or door, or the goal is no PDDL.
        MomentError: The moment is before the log's first.
    """
    if default_prob is not None and not 0 <= default_prob <= 1:
        raise CommandError(f"--default-prob: expected a number from 0 to 1, got {default_prob!r}.")
    door_map = only_doors(log.replay(scope.at_ns, scope.known_at_ns, scope.event))
    problem = PddlProblem.of(door_map)
    likely = _likely(log, scope, door_map, default_prob, progress) if len(door_map) else {}
    text = problem.dump(likely, about, wishes)
    notes = (
        _unknown(door_map, likely, default_prob) if wishes.with_costs else "",
        _without_rooms(door_map),
        "no goal: --goal ROOM, DOOR or a condition" if wishes.goal is None else "",
        "no start: --start ROOM says where the robot is"
        if wishes.start is None and problem.room_names
        else "",
    )
    told = tuple(note for note in notes if note)
    return PlanningProblem(text, len(door_map), len(problem.room_names), told)


def _likely(
    log: DoorLog,
    scope: Scope,
    door_map: DoorMap,
    default_prob: float | None,
    progress: Progress | None,
) -> dict[DoorId, Likely]:
    known_at = Moment(ns=scope.known_at_ns)
    if scope.event is not None:
        known_at = Moment(event=log.limit_of(scope))
    believed = probabilities(
        log,
        at=Moment(ns=door_map.moment_ns),  # the last event's, where an event is asked for
        known_at=known_at,
        doors=list(door_map.doors),
        progress=progress,
    )
    return {
        each.door.door_id: Likely(
            default_prob if not each.is_known and default_prob is not None else each.p_open,
            each.is_known,
        )
        for each in believed
    }


def _unknown(door_map: DoorMap, likely: Mapping[DoorId, Likely], default_prob: float | None) -> str:
    """Say of which doors too little was seen; "": none."""
    unknown = [door_id for door_id, each in likely.items() if not each.is_known]
    if not unknown:
        return ""
    named = f"{counted(len(unknown), 'door')} ({_named(door_map, unknown)})"
    if default_prob is not None:
        return f"P(open) of {named} is {default_prob:g}, by --default-prob"
    return f"P(open) of {named} rests on too little; --default-prob P sets one"


def _without_rooms(door_map: DoorMap) -> str:
    """Say which doors lead nowhere; "": none."""
    alone = [door.door_id for door in door_map.doors.values() if rooms_between(door) is None]
    if not alone:
        return ""
    return (
        f"no way leads through {counted(len(alone), 'door')} without two rooms "
        f"({_named(door_map, alone)}); to name them: annotate LOG DOOR rooms lobby,corridor"
    )


def _named(door_map: DoorMap, doors: Sequence[DoorId]) -> str:
    labels = labels_of(door_map)
    return _listed(labels.get(door_id, f"door {door_id}") for door_id in doors)


def _listed(words: Iterable[str]) -> str:
    first = list(islice(words, MOST_NAMED + 1))
    return ", ".join([*first[:MOST_NAMED], *(["…"] if len(first) > MOST_NAMED else [])])
