"""The questions that a planner can ask: one table, from which all that names them derives.

Parsing, HELP and the table of the guide are made from it; the declarations for other systems can
be, too. The first twelve are the thesis's (4.4.7), to the letter.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum


class QuestionKind(Enum):
    """What sort of answer a question has."""

    PREDICATE = "predicate"
    """T or NIL."""
    FUNCTION = "function"
    """A value; NIL where there is none."""
    ACTION = "action"
    """T once it is done and lasts; NIL where it was refused."""


class Type(Enum):
    """What a word of a question stands for."""

    DOOR = "DOOR"
    DOORS = "DOOR..."
    """One door or more; the others of a question stand for one thing each."""
    STATE = "STATE"
    NUMBER = "NUMBER"
    SECONDS = "SECONDS"
    NAME = "NAME"
    """Of a question."""
    QUESTION = "QUESTION"
    """Another question, with its words."""


class Times(Enum):
    """Which moment a question can name, behind its other words."""

    NONE = ""
    WHEN = "[TIME]"
    """What was true then; without it: now."""
    WHEN_OR_AT = "[TIME | AT TIME]"
    """The same, or AT: how likely it is at that time, by what was learnt up to now."""
    AT = "[AT TIME]"
    """How likely it is at that time; without it: now."""
    KNOWN_AT = "AT TIME"
    """What was known then; it must be there."""


@dataclass(frozen=True, slots=True)
class Question:
    """One question."""

    name: str
    kind: QuestionKind
    answer: str
    """What the answer is, in words for HELP and the guide."""
    arguments: tuple[Type, ...] = ()
    optional: tuple[Type, ...] = ()
    """May be left out; they stand behind the others."""
    times: Times = Times.NONE
    is_the_thesiss: bool = False

    @property
    def form(self) -> str:
        """How it is written: `DOOR_OPEN DOOR [TIME]`."""
        may = [f"[{each.value}]" for each in self.optional]
        words = [self.name, *(each.value for each in self.arguments), *may, self.times.value]
        return " ".join(word for word in words if word)

    @property
    def help(self) -> str:
        """Its form, its kind and its answer on one line."""
        return f"{self.form} - {self.kind.value}: {self.answer}"


def _thesis(
    name: str, kind: QuestionKind, answer: str, *arguments: Type, times: Times = Times.NONE
) -> Question:
    return Question(name, kind, answer, arguments, times=times, is_the_thesiss=True)


_P, _F, _A = QuestionKind

QUESTIONS: tuple[Question, ...] = (
    _thesis("DOOR_STATE_KNOWN", _P, "its state is not UNKNOWN", Type.DOOR, times=Times.WHEN),
    _thesis("DOOR_OPEN", _P, "it is OPEN", Type.DOOR, times=Times.WHEN),
    _thesis("DOOR_CLOSED", _P, "it is CLOSED", Type.DOOR, times=Times.WHEN),
    _thesis("PROBABILITY_DOOR_OPEN", _F, "its P(open) in the map; with AT: the learnt one",
            Type.DOOR, times=Times.WHEN_OR_AT),
    _thesis("PROBABILITY_DOOR_CLOSED", _F, "its P(closed) in the map; with AT: the learnt one",
            Type.DOOR, times=Times.WHEN_OR_AT),
    _thesis("GET_OPEN_DOOR", _F, "the OPEN door with the lowest id", times=Times.WHEN),
    _thesis("GET_CLOSED_DOOR", _F, "the CLOSED door with the lowest id", times=Times.WHEN),
    _thesis("SET_DOOR_OPEN", _A, "sets its state to OPEN", Type.DOOR),
    _thesis("SET_DOOR_CLOSED", _A, "sets its state to CLOSED", Type.DOOR),
    _thesis("SET_OPEN_PROBABILITY", _A, "sets its P(open), 0 to 1", Type.DOOR, Type.NUMBER),
    _thesis("SET_CLOSED_PROBABILITY", _A, "sets its P(closed), 0 to 1", Type.DOOR, Type.NUMBER),
    _thesis("REMOVE_DOOR", _A, "takes it out of the map", Type.DOOR),
    Question("DOOR_STATE", _F, "its state", (Type.DOOR,), times=Times.WHEN),
    Question("DOORS", _F, "all doors, or those in a state, ids ascending", (), (Type.STATE,),
             Times.WHEN),
    Question("WHY", _F, "what set its state: (event kind state time actor source reason)",
             (Type.DOOR,), times=Times.WHEN),
    Question("BELIEVED", _F, "the answer to another question by what was known then",
             (Type.QUESTION,), times=Times.KNOWN_AT),
    Question("BEST_TIME", _F, "when it is likeliest OPEN (or CLOSED) next: (start end P)",
             (Type.DOOR,), (Type.STATE,)),
    Question("NEXT_DOOR", _F, "the one that is likeliest open; the first of several as likely",
             (Type.DOORS,), times=Times.AT),
    Question("WAIT_UNTIL", _P, "it is in the state, now or before the seconds are over",
             (Type.DOOR, Type.STATE, Type.SECONDS)),
    Question("HELP", _F, "all questions, or how one is asked", (), (Type.NAME,)),
)  # fmt: skip
"""All of them, the thesis's first."""

BY_NAME: Mapping[str, Question] = {question.name: question for question in QUESTIONS}


def similar(name: str) -> str:
    """Return a sentence with the names that may be meant by one that is none; "": no idea."""
    from difflib import get_close_matches

    close = get_close_matches(name.upper(), BY_NAME, n=2)
    return f" Did you mean {' or '.join(close)}?" if close else ""


def table(questions: Iterable[Question] = QUESTIONS) -> str:
    """Return the table of the guide, as Markdown."""
    rows = [
        f"| `{each.form.replace('|', chr(92) + '|')}` | {each.kind.value} | {each.answer} |"
        for each in questions
    ]
    return "\n".join(["| question | kind | answer |", "| --- | --- | --- |", *rows])
