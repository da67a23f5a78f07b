"""The doors of one moment, found by the words that planners have for them, and answers about them.

    DOOR_3          the door of id 3, whatever doors are called
    DOOR_main_door  the door that is called `main_door`; DOOR_ground/main_door, where several are
    "main door"     what the command line takes: a name, level/name, an id, or id:3

A name of several doors means none of them: the error lists their ids.

Some answers follow from the doors of a moment alone; those of other moments are cached until the
doors of now change. Answers about what is likely follow from beliefs, which are learnt once and
then updated. For a time that has passed, only what was known by then counts, and the doors that
there were: the past is not forecast.
"""

from __future__ import annotations

import math
import re
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TypeVar

import numpy as np

from semmap_log.analysis.beliefs import best_time
from semmap_log.analysis.beliefs.door_beliefs import LATER, NOW, default_estimator
from semmap_log.analysis.probabilities.belief_fold import BeliefProjection, Beliefs, by_name
from semmap_log.core.folds.door_index import resolve_door
from semmap_log.core.folds.levels import DoorsPresent, only_doors
from semmap_log.core.model.doors import MAX_DOOR_ID, Door, DoorId, DoorMap, DoorState
from semmap_log.core.model.events import Retracted
from semmap_log.core.model.moments import Moment, format_wall
from semmap_log.core.texts import counted
from semmap_log.errors import UnknownDoorError
from semmap_log.live.planners.parsed_questions import DOOR, ParsedQuestion, QuestionKind
from semmap_log.live.planners.question_lines import Answer, Atom
from semmap_log.log import DoorLog


class LikelyAnswers:
    """Answers them; may be used by several threads."""

    def __init__(self) -> None:
        self._learnt = LearntDoors()

    def forget(self) -> None:
        """Learn again: the log lost its end."""
        self._learnt.forget()

    def steps(
        self, log: DoorLog, now: KnownDoors, asked: ParsedQuestion, now_ns: int
    ) -> Iterator[Answer | None]:
        """Yield None after each door of several, then the answer.

        Args:
            log: At least as new as the doors of now.
            now: These.
            asked: The question: NEXT_DOOR, BEST_TIME, or P at a time.
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
        self, log: DoorLog, now: KnownDoors, asked: ParsedQuestion, now_ns: int
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
        self, log: DoorLog, now: KnownDoors, asked: ParsedQuestion, now_ns: int
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
        """Return P(open) of a door at a time, and whether enough is known for that."""
        event = now.view.door_map.event
        return self._learnt.p_open(log, event, door.door_id, now_ns=now_ns, time_ns=time_ns)


def _time_ns(log: DoorLog, asked: ParsedQuestion, now_ns: int) -> int:
    """Return the time that a question is about; without one it is now."""
    if asked.learnt_at is None:
        return now_ns
    time_ns = log.instant(log.moment(asked.learnt_at, now_ns=now_ns))
    assert time_ns is not None, "only None means no time"
    return time_ns


def _passed(time_ns: int, now_ns: int) -> Moment:
    """Return a time that has passed as a moment; none for one that has not."""
    return Moment(ns=time_ns) if time_ns < now_ns else Moment()


def _best_time(log: DoorLog, now: KnownDoors, asked: ParsedQuestion, now_ns: int) -> Answer:
    door_id = now.view.door(asked.doors[0]).door_id
    is_closed = asked.state is DoorState.CLOSED
    found = best_time(log, door_id, "closed" if is_closed else "open", at=Moment(ns=now_ns))
    if not found.next_ones:
        return nothing(asked, "too little was seen of it.")
    best = max(found.next_ones, key=lambda hours: hours.probability)
    times = [format_wall(ns, found.tz) for ns in (best.start_ns, best.end_ns)]
    return Answer([*times, best.probability])


class LearntDoors:
    """What `probabilities` says, of a log that goes on: new events are taken in, not all again."""

    def __init__(self) -> None:
        self._learning = threading.Lock()
        self._event = -1
        """The last event that is taken in."""
        self._by_estimator: dict[str, Beliefs] = {}

    def p_open(
        self, log: DoorLog, event: int, door: DoorId, *, now_ns: int, time_ns: int
    ) -> tuple[float, bool]:
        """Return P(open) of a door, and whether enough was seen of it for that.

        Args:
            log: With all that was written.
            event: Up to which.
            door: Which.
            now_ns: What had happened by then counts.
            time_ns: Of the forecast; before now, only what had happened by then counts.
        """
        known_ns = min(now_ns, time_ns)
        with self._learning:
            self._take_in(log, event)
            beliefs = self._by_estimator[default_estimator(time_ns - known_ns)]
            said = beliefs.predict(door, np.array([time_ns]), np.array([known_ns]))
        return float(said.p_open[0]), bool(said.is_known[0])

    def forget(self) -> None:
        """Start over with the next question: the log lost its end."""
        with self._learning:
            self._by_estimator = {}

    def _take_in(self, log: DoorLog, event: int) -> None:
        """Learn what came since, up to an event; a retraction starts it over.

        Another thread may have learnt of later ones already.
        """
        if self._by_estimator and event > self._event:
            since, until = Moment(event=self._event + 1), Moment(event=event + 1)
            batches = list(log.batches(since, until))
            if any(Retracted in batch for batch in batches):
                self._by_estimator = {}
            else:
                for batch in batches:
                    self._by_estimator[NOW].evidence.apply(batch)
                self._event = event
        if not self._by_estimator:
            projection = BeliefProjection(NOW, log.info.timezone)
            near = log.fold(projection, event=event) if event >= 0 else projection.initial()
            far = Beliefs(by_name(LATER), near.clock, near.evidence)
            self._by_estimator = {NOW: near, LATER: far}
            self._event = event


HOLDS = Answer(value=True)


def state_answer(view: DoorView, asked: ParsedQuestion) -> Answer:
    """Return what the doors of a moment answer to one of `STATE_QUESTIONS`."""
    try:
        return STATE_QUESTIONS[asked.question.name](view, asked)
    except UnknownDoorError as error:
        return nothing(asked, str(error))


def nothing(asked: ParsedQuestion, reason: str) -> Answer:
    """Return the answer that a question has where there is nothing to say, or it was refused."""
    return Answer(None if asked.question.kind is QuestionKind.FUNCTION else False, reason)


def _holds(predicate: Callable[[DoorState], bool], view: DoorView, asked: ParsedQuestion) -> Answer:
    state = view.door(asked.doors[0]).state
    return HOLDS if predicate(state) else Answer(value=False, reason=f"it is {state.name}.")


def _is(wanted: DoorState, state: DoorState) -> bool:
    return state is wanted


def _is_any_but_unknown(state: DoorState) -> bool:
    return state is not DoorState.UNKNOWN


def _probability(value: Callable[[Door], float], view: DoorView, asked: ParsedQuestion) -> Answer:
    found = value(view.door(asked.doors[0]))
    return Answer(None, "it has none.") if math.isnan(found) else Answer(found)


def _any(state: DoorState, view: DoorView, _: ParsedQuestion) -> Answer:
    ids = view.ids(state)
    return Answer(atom_of(ids[0])) if ids else Answer(None, f"no door is {state.name}.")


def _doors(view: DoorView, asked: ParsedQuestion) -> Answer:
    return Answer([atom_of(door_id) for door_id in view.ids(asked.state)])


def _state(view: DoorView, asked: ParsedQuestion) -> Answer:
    return Answer(atom_of_state(view.door(asked.doors[0])))


STATE_QUESTIONS: Mapping[str, Callable[[DoorView, ParsedQuestion], Answer]] = {
    "DOOR_STATE_KNOWN": partial(_holds, _is_any_but_unknown),
    "DOOR_OPEN": partial(_holds, partial(_is, DoorState.OPEN)),
    "DOOR_CLOSED": partial(_holds, partial(_is, DoorState.CLOSED)),
    "PROBABILITY_DOOR_OPEN": partial(_probability, lambda door: door.prob_open),
    "PROBABILITY_DOOR_CLOSED": partial(_probability, lambda door: door.prob_closed),
    "GET_OPEN_DOOR": partial(_any, DoorState.OPEN),
    "GET_CLOSED_DOOR": partial(_any, DoorState.CLOSED),
    "DOOR_STATE": _state,
    "DOORS": _doors,
}
"""Name -> what answers it."""


T = TypeVar("T")

MOST_REMEMBERED = 64
"""Moments."""


class KnownDoors:
    """What is known until the next change; may be used by several threads."""

    def __init__(self, view: DoorView) -> None:
        self.view = view
        self._remembered: OrderedDict[object, object] = OrderedDict()
        self._mutex = threading.Lock()

    def view_at(self, log: DoorLog, when: Moment, known_at: Moment) -> DoorView:
        """Return the doors of a moment; of none: those of now.

        Args:
            log: At least as new as the doors of now.
            when: What was true then.
            known_at: Only what was known then.

        Raises:
            LogError: The log cannot be read, or has no such event.
        """
        if when == known_at == Moment():
            return self.view
        return self.remembered(
            (when, known_at), lambda: DoorView(log.replay(at=when, known_at=known_at))
        )

    def remembered(self, key: object, look_up: Callable[[], T]) -> T:
        """Return what was looked up before, or look it up."""
        with self._mutex:
            if key in self._remembered:
                self._remembered.move_to_end(key)
                return self._remembered[key]  # type: ignore[return-value]
        found = look_up()
        with self._mutex:
            self._remembered[key] = found
            if len(self._remembered) > MOST_REMEMBERED:
                self._remembered.popitem(last=False)
        return found


_DOOR_ID = re.compile(r"(?:0|[1-9][0-9]{0,9})")


def atom_of(door_id: int) -> Atom:
    """Return how answers call a door: `DOOR_3`."""
    return Atom(f"{DOOR}{door_id}")


def atom_of_state(door: Door) -> Atom:
    """Return how answers call a door's state: `OPEN`."""
    return Atom(door.state.name)


class DoorView:
    """The doors of one moment; does not change."""

    def __init__(self, door_map: DoorMap) -> None:
        door_map = only_doors(door_map)
        assert isinstance(door_map.doors, DoorsPresent), "a map that a log gave"
        self.door_map = door_map
        self._doors = door_map.doors
        self._found: dict[str, Door] = {}
        self._names: dict[str, list[DoorId]] | None = None

    def door(self, word: str) -> Door:
        """Return the door that a word means.

        Raises:
            UnknownDoorError: None, or more than one.
        """
        found = self._found.get(word)
        if found is None:
            found = self._doors[self._id_of(word)]
            if word.startswith(DOOR):  # of others no end of spellings means one door: `003`
                self._found[word] = found
        return found

    def find(self, word: str) -> Door | None:
        """Return the door that a word means; None: none, or more than one."""
        try:
            return self.door(word)
        except UnknownDoorError:
            return None

    def ids(self, state: DoorState | None = None) -> list[DoorId]:
        """Return the doors in a state, ids ascending; None: in any."""
        return list(self._doors) if state is None else self._doors.in_state(state)

    def _id_of(self, word: str) -> DoorId:
        if not word.startswith(DOOR):
            return resolve_door(word, self.door_map)
        called = word.removeprefix(DOOR)
        if _DOOR_ID.fullmatch(called):
            door_id = DoorId(int(called))
            if door_id > MAX_DOOR_ID or door_id not in self._doors:
                raise UnknownDoorError(f"no door {word} is in the map.")
            return door_id
        found = self._called(called) or self._called(word)
        if found is None and "/" in called:
            return resolve_door(called, self.door_map)
        if found is None:
            raise UnknownDoorError(f"no door is called {called!r}.")
        return found

    def _called(self, name: str) -> DoorId | None:
        """Return the only door of a name; None: no door bears it.

        Raises:
            UnknownDoorError: Several do.
        """
        if self._names is None:
            names: dict[str, list[DoorId]] = {}
            for door_id, each in self._doors.names().items():
                names.setdefault(each, []).append(door_id)
            self._names = names
        ids = self._names.get(name, [])
        if len(ids) > 1:
            which = " or ".join(map(atom_of, ids))
            raise UnknownDoorError(
                f"{counted(len(ids), 'door')} are called {name!r}; say which by {which}."
            )
        return ids[0] if ids else None
