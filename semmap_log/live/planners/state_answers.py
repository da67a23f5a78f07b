"""What the doors of a moment answer; nothing but them is asked."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial

from semmap_log.core.model.doors import Door, DoorState
from semmap_log.errors import UnknownDoorError
from semmap_log.live.planners.asked import AskedQuestion
from semmap_log.live.planners.door_view import DoorView, atom_of, atom_of_state
from semmap_log.live.planners.question_lines import Answer
from semmap_log.live.planners.questions import QuestionKind

HOLDS = Answer(value=True)


def state_answer(view: DoorView, asked: AskedQuestion) -> Answer:
    """Return what the doors of a moment answer to one of `STATE_QUESTIONS`."""
    try:
        return STATE_QUESTIONS[asked.question.name](view, asked)
    except UnknownDoorError as error:
        return nothing(asked, str(error))


def nothing(asked: AskedQuestion, reason: str) -> Answer:
    """Return the answer that a question has where there is nothing to say, or it was refused."""
    return Answer(None if asked.question.kind is QuestionKind.FUNCTION else False, reason)


def _holds(predicate: Callable[[DoorState], bool], view: DoorView, asked: AskedQuestion) -> Answer:
    state = view.door(asked.doors[0]).state
    return HOLDS if predicate(state) else Answer(value=False, reason=f"it is {state.name}.")


def _is(wanted: DoorState, state: DoorState) -> bool:
    return state is wanted


def _is_any_but_unknown(state: DoorState) -> bool:
    return state is not DoorState.UNKNOWN


def _probability(value: Callable[[Door], float], view: DoorView, asked: AskedQuestion) -> Answer:
    found = value(view.door(asked.doors[0]))
    return Answer(None, "it has none.") if math.isnan(found) else Answer(found)


def _any(state: DoorState, view: DoorView, _: AskedQuestion) -> Answer:
    ids = view.ids(state)
    return Answer(atom_of(ids[0])) if ids else Answer(None, f"no door is {state.name}.")


def _doors(view: DoorView, asked: AskedQuestion) -> Answer:
    return Answer([atom_of(door_id) for door_id in view.ids(asked.state)])


def _state(view: DoorView, asked: AskedQuestion) -> Answer:
    return Answer(atom_of_state(view.door(asked.doors[0])))


STATE_QUESTIONS: Mapping[str, Callable[[DoorView, AskedQuestion], Answer]] = {
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
