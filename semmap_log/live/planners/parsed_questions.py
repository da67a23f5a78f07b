"""The questions that a planner can ask, and a question's words parsed to what they stand for.

One table has them all. Parsing, HELP and the table of the guide are made from it; the declarations
for other systems can be, too. The first twelve are the thesis's (4.4.7), to the letter.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import NoReturn, TypeAlias

from semmap_log.core.model.doors import DoorState
from semmap_log.errors import QuestionError
from semmap_log.interop.formats.parsing.problems import shown

Word: TypeAlias = str | int | float
"""A word of a line, or an argument in JSON."""

AT = "AT"

MOST_SECONDS = 86_400.0
"""A client that wants to wait longer sends the question again."""
MOST_WORDS = 1000
"""Of a question, its name and the doors of NEXT_DOOR included."""
MOST_WORD = 1000
"""Characters of a word."""


@dataclass(frozen=True, slots=True)
class ParsedQuestion:
    """A question that was understood."""

    question: Question
    doors: tuple[str, ...] = ()
    """As they were called."""
    state: DoorState | None = None
    number: float = 0.0
    """A probability, or how many seconds to wait."""
    name: str | None = None
    """Of the question that HELP is about."""
    when: str | int | None = None
    """What was true then; None: now."""
    known_at: str | int | None = None
    """By what was known then; None: all."""
    learnt_at: str | int | None = None
    """How likely then."""
    command_id: bytes | None = None

    @property
    def is_of_now(self) -> bool:
        """Whether it asks for what is true now."""
        return self.when is self.known_at is self.learnt_at is None


def read_words(words: Sequence[Word], command_id: bytes | None = None) -> ParsedQuestion:
    """Parse a question's words, its name first.

    Raises:
        QuestionError: There is no such question, its form is another, or it is too long.
    """
    if not words:
        raise QuestionError(f"expected a question such as {BY_NAME['DOOR_OPEN'].form}, got none")
    _check_words(words)
    name = words[0]
    question = BY_NAME.get(name) if isinstance(name, str) else None
    if question is None:
        raise QuestionError(
            f"{shown(name)} is no question.{similar(str(name))} HELP names them all."
        )
    if command_id is not None and question.kind is not QuestionKind.ACTION:
        raise QuestionError(f"{name}: only an action takes a command id")
    return _Reader(question, list(words[1:])).read(command_id)


def _check_words(words: Sequence[Word]) -> None:
    """Check that a question has no more words than one may, and none that is too long.

    Raises:
        QuestionError: It has.
    """
    if len(words) > MOST_WORDS:
        raise QuestionError(too_many())
    longest = max((len(word) for word in words if isinstance(word, str)), default=0)
    if longest > MOST_WORD:
        raise QuestionError(f"expected words of at most {MOST_WORD:,} characters, got {longest:,}")


def too_many() -> str:
    """Return the message about a question of too many words."""
    return f"expected at most {MOST_WORDS:,} words, got more"


class _Reader:
    """Takes one word after the other."""

    def __init__(self, question: Question, words: list[Word]) -> None:
        self._question = question
        self._words = words

    def read(self, command_id: bytes | None) -> ParsedQuestion:
        """Return the question."""
        question = self._question
        if question.times is Times.KNOWN_AT:
            return self._read_believed()
        asked = ParsedQuestion(question, command_id=command_id)
        for each in question.arguments:
            if not self._words:
                self._refuse(f"expected {each.value}, got nothing more")
            asked = self._take(each, asked)
        for each in question.optional:
            if self._words and self._fits(each, self._words[0]):
                asked = self._take(each, asked)
        asked = self._take_time(asked)
        if self._words:
            self._refuse(
                f"got {shown(self._words[0])} besides; what has blanks in it stands in quotes"
            )
        return asked

    def _read_believed(self) -> ParsedQuestion:
        if len(self._words) < 3 or self._words[-2] != AT:
            self._refuse("expected a question, AT and a time")
        *inner, _, time = self._words
        if inner[0] == self._question.name:
            self._refuse(f"{inner[0]} cannot be asked of what was known")
        asked = read_words(inner)
        takes_time = asked.question.times in (Times.WHEN, Times.WHEN_OR_AT)
        if not (takes_time and asked.learnt_at is None):
            self._refuse(f"{asked.question.name} cannot be asked of what was known")
        return replace(asked, known_at=self._time(time))

    def _take_time(self, asked: ParsedQuestion) -> ParsedQuestion:
        """Return the question with the time that its last words name, if they do."""
        times = self._question.times
        if not self._words:
            return asked
        if self._words[0] == AT and times in (Times.AT, Times.WHEN_OR_AT):
            if len(self._words) < 2:
                self._refuse("expected a time behind AT")
            del self._words[0]
            return replace(asked, learnt_at=self._time(self._words.pop(0)))
        if times in (Times.WHEN, Times.WHEN_OR_AT):
            return replace(asked, when=self._time(self._words.pop(0)))
        return asked

    def _take(self, what: Type, asked: ParsedQuestion) -> ParsedQuestion:
        word = self._words.pop(0)
        if what is Type.DOOR:
            return replace(asked, doors=(self._door(word),))
        if what is Type.DOORS:
            doors = [self._door(word)]
            while self._words and self._words[0] != AT:
                doors.append(self._door(self._words.pop(0)))
            return replace(asked, doors=tuple(doors))
        if what is Type.STATE:
            return replace(asked, state=self._state(word))
        if what is Type.NAME:
            return replace(asked, name=str(word))
        return replace(asked, number=self._number(what, word))

    @staticmethod
    def _fits(what: Type, word: Word) -> bool:
        """Return whether a word is what may be left out, and not a time."""
        return what is not Type.STATE or word in DoorState.__members__

    def _door(self, word: Word) -> str:
        if isinstance(word, int):
            return f"{DOOR}{word}"
        if not isinstance(word, str) or not word:
            self._refuse(f"expected a door such as {DOOR}3, got {shown(word)}")
        return word

    def _state(self, word: Word) -> DoorState:
        state = DoorState.__members__.get(word) if isinstance(word, str) else None
        if state is None:
            self._refuse(f"expected one of {' '.join(DoorState.__members__)}, got {shown(word)}")
        if self._question.name == "BEST_TIME" and not state.is_known:
            self._refuse(f"expected OPEN or CLOSED, got {word}")
        return state

    def _number(self, what: Type, word: Word) -> float:
        try:
            number = float(word)
        except (ValueError, OverflowError):
            self._refuse(f"expected a number, got {shown(word)}")
        if what is Type.SECONDS and not 0 <= number <= MOST_SECONDS:
            self._refuse(f"expected 0 to {MOST_SECONDS:,.0f} seconds, got {shown(word)}")
        return number

    def _time(self, word: Word) -> str | int:
        if isinstance(word, float):
            self._refuse(f"expected a time as a text or in whole nanoseconds, got {shown(word)}")
        return word

    def _refuse(self, problem: str) -> NoReturn:
        raise QuestionError(f"{self._question.form}: {problem}")


DOOR = "DOOR_"
"""What stands before a door's id, or its name, as the thesis writes it."""


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
    """The moments that a question can name, after its other words."""

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
    """May be left out; they follow the others."""
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
