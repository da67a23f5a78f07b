"""Answers about what is likely: at a time, by what was learnt up to now.

Of a time that has passed, what was known by then counts, and the doors that there were: one does
not foretell the past.
"""

from __future__ import annotations

from collections.abc import Iterator

from semmap_log.analysis.beliefs import best_time
from semmap_log.core.model.doors import Door, DoorId, DoorState
from semmap_log.core.model.moments import Moment, format_wall
from semmap_log.live.planners.asked import AskedQuestion
from semmap_log.live.planners.door_view import atom_of
from semmap_log.live.planners.known_doors import KnownDoors
from semmap_log.live.planners.learnt import LearntDoors
from semmap_log.live.planners.question_lines import Answer
from semmap_log.live.planners.state_answers import nothing
from semmap_log.log.door_log.door_log import DoorLog


class LikelyAnswers:
    """Answers them; may be used by several threads."""

    def __init__(self) -> None:
        self._learnt = LearntDoors()

    def forget(self) -> None:
        """Learn anew: the log lost its end."""
        self._learnt.forget()

    def steps(
        self, log: DoorLog, now: KnownDoors, asked: AskedQuestion, now_ns: int
    ) -> Iterator[Answer | None]:
        """Yield None after each door of several, then the answer.

        Args:
            log: At least as new as the doors of now.
            now: These.
            asked: NEXT_DOOR, BEST_TIME, or P at a time.
            now_ns: When that is.

        Raises:
            UnknownDoorError: There is no such door.
            SemmapError: It cannot be answered.
        """
        if asked.question.name == "BEST_TIME":
            yield _best_time(log, now, asked, now_ns)
        elif asked.question.name == "NEXT_DOOR":
            yield from self._next_door(log, now, asked, now_ns)
        else:
            yield self._probability(log, now, asked, now_ns)

    def _next_door(
        self, log: DoorLog, now: KnownDoors, asked: AskedQuestion, now_ns: int
    ) -> Iterator[Answer | None]:
        time_ns = _time_ns(log, asked, now_ns)
        view = now.view_at(log, _passed(time_ns, now_ns), Moment())
        said: dict[DoorId, float] = {}
        for word in dict.fromkeys(asked.doors):
            door = view.find(word)
            if door is not None and door.door_id not in said:
                said[door.door_id], _ = self._p_open(log, now, door, time_ns, now_ns)
            yield None
        if said:
            yield Answer(atom_of(max(said, key=said.__getitem__)))
        else:
            yield nothing(asked, "none of them is in the map.")

    def _probability(
        self, log: DoorLog, now: KnownDoors, asked: AskedQuestion, now_ns: int
    ) -> Answer:
        time_ns = _time_ns(log, asked, now_ns)
        door = now.view_at(log, _passed(time_ns, now_ns), Moment()).door(asked.doors[0])
        p_open, is_known = self._p_open(log, now, door, time_ns, now_ns)
        value = p_open if asked.question.name == "PROBABILITY_DOOR_OPEN" else 1.0 - p_open
        if not is_known:
            return nothing(asked, f"too little was seen of it; of such doors: {value:.3g}.")
        return Answer(value)

    def _p_open(
        self, log: DoorLog, now: KnownDoors, door: Door, time_ns: int, now_ns: int
    ) -> tuple[float, bool]:
        """Return P(open) of a door at a time, and whether enough is known to tell."""
        event = now.view.door_map.event
        return self._learnt.p_open(log, event, door.door_id, now_ns=now_ns, time_ns=time_ns)


def _time_ns(log: DoorLog, asked: AskedQuestion, now_ns: int) -> int:
    """Return the time that a question is about; without one it is now."""
    if asked.learnt_at is None:
        return now_ns
    time_ns = log.instant(log.moment(asked.learnt_at, now_ns=now_ns))
    assert time_ns is not None, "only None means no time"
    return time_ns


def _passed(time_ns: int, now_ns: int) -> Moment:
    """Return a time that has passed as a moment; none for one that has not."""
    return Moment(ns=time_ns) if time_ns < now_ns else Moment()


def _best_time(log: DoorLog, now: KnownDoors, asked: AskedQuestion, now_ns: int) -> Answer:
    door_id = now.view.door(asked.doors[0]).door_id
    is_closed = asked.state is DoorState.CLOSED
    found = best_time(log, door_id, "closed" if is_closed else "open", at=Moment(ns=now_ns))
    if not found.next_ones:
        return nothing(asked, "too little was seen of it.")
    best = max(found.next_ones, key=lambda hours: hours.probability)
    times = [format_wall(ns, found.tz) for ns in (best.start_ns, best.end_ns)]
    return Answer([*times, best.probability])
