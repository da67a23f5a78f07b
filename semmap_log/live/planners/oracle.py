"""The door oracle: answers what planners ask of a log, and does what they want done.

It knows no socket. What is true now is held in memory and refreshed at each change. Questions of
the past replay the log; their answers are remembered until it changes. Some questions wait until a
door is in a state. An action is one commit, answered with T once it is durable. Several threads may
ask.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from semmap_log import errors
from semmap_log.analysis.recorded_later import recorded_later, what_set
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.commits import Note, content_of
from semmap_log.core.model.doors import DoorId, DoorMap, DoorState
from semmap_log.core.model.events import DoorRemoved, DoorUpdated, Event, Retracted
from semmap_log.core.model.meaning import Changed
from semmap_log.core.model.moments import Moment, format_wall
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.live.planners import door_view, parsed_questions
from semmap_log.live.planners.question_lines import Answer, Value, as_word
from semmap_log.live.ros.serving.door_server import when_ns
from semmap_log.log import DoorLog, DoorLogWriter, Scope

LIKELY_QUESTIONS = {"BEST_TIME", "NEXT_DOOR"}

ENDS = Answer(value=False, reason="the server ends.")


def is_wait(asked: parsed_questions.ParsedQuestion) -> bool:
    """Return whether a question may wait for long, and for nothing but a change of a door."""
    return asked.question.name == "WAIT_UNTIL"


def is_likely(asked: parsed_questions.ParsedQuestion) -> bool:
    """Return whether a question is about what is likely: its answer may take long."""
    return asked.question.name in LIKELY_QUESTIONS or asked.learnt_at is not None


class Oracle:
    """Answers questions about the doors of a log."""

    def __init__(
        self,
        doors: QueriedDoors,
        *,
        say: Callable[[str], object] = lambda _: None,
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        """Look at the doors; from then on somebody has to call `refresh` after each change.

        Args:
            doors: What the questions are about.
            say: Called for actions that are refused, with the reason.
            clock_ns: What `now` is, from which `2h ago` and forecasts count; where the log's end
                is later, that is.

        Raises:
            LogError: The log cannot be read.
        """
        self._doors = doors
        self._say = say
        self._clock_ns = clock_ns
        self._likely = door_view.LikelyAnswers()
        self._waits = Waits()
        self._refreshing = threading.Lock()
        self._now = door_view.KnownDoors(door_view.DoorView(doors.door_map()))
        self._failure: errors.SemmapError | OSError | None = None

    @property
    def failure(self) -> errors.SemmapError | OSError | None:
        """Why the doors cannot be known any more; None: they are."""
        return self._failure

    def refresh(self) -> None:
        """Take the doors up as they are now: after each change, by whoever made or saw it.

        From then on, questions about now are answered from them; those that wait are checked.
        """
        with self._refreshing:
            try:
                view = door_view.DoorView(self._doors.door_map())
            except (errors.SemmapError, OSError) as error:
                self._failure = error
                return
            before, self._now = self._now.view, door_view.KnownDoors(view)
            if view.door_map.event < before.door_map.event:
                self._likely.forget()
            self._look_between(before, view)
        self._waits.look(view)

    def at_once(self, asked: parsed_questions.ParsedQuestion) -> Answer | None:
        """Return the answer if that takes no time; None: `answer` it, or let it `wait`.

        Raises:
            SemmapError: It cannot be answered.
        """
        if asked.question.name in door_view.STATE_QUESTIONS and asked.is_of_now:
            if self._failure is not None:
                raise self._failure
            return door_view.state_answer(self._now.view, asked)
        return _help(asked) if asked.question.name == "HELP" else None

    def answer(self, asked: parsed_questions.ParsedQuestion, client: str = "") -> Answer:
        """Return the answer, however long that takes; as `steps`."""
        *_, answer = self.steps(asked, client)
        assert answer is not None, "the last step gives it"
        return answer

    def steps(
        self, asked: parsed_questions.ParsedQuestion, client: str = ""
    ) -> Iterator[Answer | None]:
        """Yield None as long as there is more to do, then the answer.

        Args:
            asked: The question.
            client: Who asks, for the note of what an action changes.

        Raises:
            SemmapError: It cannot be answered.
        """
        if (at_once := self.at_once(asked)) is not None:
            yield at_once
        elif asked.question.kind is parsed_questions.QuestionKind.ACTION:
            yield self._act(asked, client)
        elif is_wait(asked):
            yield self._wait_here(asked)
        else:
            yield from self._found(asked)

    def _found(self, asked: parsed_questions.ParsedQuestion) -> Iterator[Answer | None]:
        """Yield the steps of a question that reads the log."""
        if self._failure is not None:
            raise self._failure
        try:
            yield from self._look_up(asked)
        except errors.UnknownDoorError as error:
            yield door_view.nothing(asked, f"{error} {self._recorded_later(asked)}".strip())
        except errors.MomentError as error:
            problem = f"{error} What has blanks in it stands in quotes."
            raise errors.QuestionError(f"{asked.question.form}: {problem}") from error

    def wait(
        self, asked: parsed_questions.ParsedQuestion, done: Callable[[Answer], None]
    ) -> Callable[[Answer], None]:
        """Let a question wait; `done` is called with its answer, once, maybe before this returns.

        Returns:
            What ends the waiting with another answer: that the time is over, that the server ends.
        """
        assert asked.state is not None
        wait = Wait(asked.doors[0], asked.state, done)
        wait.answer_in(self._now.view)  # what cannot be answered must not wait
        self._waits.add(wait)
        if (found := wait.answer_in(self._now.view)) is not None:  # after adding: nothing is missed
            self._waits.end(wait, found)
        return lambda answer: self._waits.end(wait, answer)

    def _look_between(self, before: door_view.DoorView, view: door_view.DoorView) -> None:
        """Look at the doors after each commit of several that came at once, if somebody waits.

        A door that was opened and closed meanwhile was open.
        """
        words, end = self._waits.doors(), view.door_map.event
        if not words or end <= before.door_map.event + 1:
            return
        log = self._doors.log
        found = [view.find(word) for word in words]
        doors = None if None in found else {door.door_id for door in found if door}
        try:
            for followed in log.commits_after(before.door_map.event):
                event = followed.commit.last_event
                if event >= end:
                    return
                if doors is None or _may_change(followed.batch, doors):
                    self._waits.look(door_view.DoorView(log.replay(at=Moment(event=event))))
        except (errors.SemmapError, OSError) as error:
            self._say(f"WAIT_UNTIL: what was so for a moment may be missed: {error}")

    def _act(self, asked: parsed_questions.ParsedQuestion, client: str) -> Answer:
        try:
            act(self._doors, asked, client)
        except (errors.SemmapError, OSError) as error:
            called = " ".join([asked.question.name, *map(as_word, asked.doors)])
            self._say(f"{called}{f' from {client}' if client else ''}: refused: {error}")
            return Answer(value=False, reason=str(error))
        return door_view.HOLDS

    def _wait_here(self, asked: parsed_questions.ParsedQuestion) -> Answer:
        answers: list[Answer] = []
        answered = threading.Event()

        def done(answer: Answer) -> None:
            answers.append(answer)
            answered.set()

        end = self.wait(asked, done)
        if not answered.wait(asked.number):
            end(time_is_over(asked))
        answered.wait()
        return answers[0]

    def _recorded_later(self, asked: parsed_questions.ParsedQuestion) -> str:
        """Return the note that events were recorded later, for a question about what was known."""
        if asked.known_at is None:
            return ""
        log = self._doors.log
        now_ns = max(self._clock_ns(), self._now.view.door_map.latest_ns)
        when, known_at = (log.moment(t, now_ns=now_ns) for t in (asked.when, asked.known_at))
        return recorded_later(log, when, known_at, remedy='ask "{then}" without AT')

    def _look_up(self, asked: parsed_questions.ParsedQuestion) -> Iterator[Answer | None]:
        """Yield the steps to what the log reports of another moment, or of what is likely."""
        now = self._now
        log = self._doors.log  # not before: it must be as new
        now_ns = max(self._clock_ns(), now.view.door_map.latest_ns)
        name = asked.question.name
        if is_likely(asked):
            yield from self._likely.steps(log, now, asked, now_ns)
            return
        when = log.moment(asked.when, now_ns=now_ns)
        known_at = log.moment(asked.known_at, now_ns=now_ns)
        view = now.view_at(log, when, known_at)
        if name == "WHY":
            is_now = when == known_at == Moment()  # which the log may have passed
            scope = Scope(event=view.door_map.event) if is_now else log.scope(when, known_at)
            yield _why(log, view, asked, scope)
        else:
            yield door_view.state_answer(view, asked)


def time_is_over(asked: parsed_questions.ParsedQuestion) -> Answer:
    """Return the answer to a question that waited in vain."""
    assert asked.state is not None
    return Answer(value=False, reason=f"it was not {asked.state.name} within {asked.number:g} s.")


def _may_change(batch: EventBatch, doors: set[DoorId]) -> bool:
    """Return whether a commit may set the state of one of some doors."""
    return Retracted in batch or bool(batch.of_doors(doors).any())


def _help(asked: parsed_questions.ParsedQuestion) -> Answer:
    if asked.name is None:
        return Answer([question.help for question in parsed_questions.QUESTIONS])
    question = parsed_questions.BY_NAME.get(asked.name)
    if question is None:
        raise errors.QuestionError(
            f"{shown(asked.name)} is no question.{parsed_questions.similar(asked.name)}"
        )
    return Answer(question.help)


def _why(
    log: DoorLog, view: door_view.DoorView, asked: parsed_questions.ParsedQuestion, scope: Scope
) -> Answer:
    """Return what set a door's state: its event, when, who and why.

    Args:
        log: The log.
        view: The doors then.
        asked: The question.
        scope: Which events count.
    """
    door = view.door(asked.doors[0])
    entry = what_set(log, door.door_id, scope)
    assert entry is not None, "who adds a door says its state"
    when = format_wall(entry.folds_ns, log.info.timezone)
    who: list[Value] = [entry.actor, entry.source, entry.reason]
    return Answer([entry.number, entry.kind, door_view.atom_of_state(door), when, *who])


@dataclass(frozen=True, slots=True, eq=False)
class Wait:
    """A question that waits."""

    door: str
    state: DoorState
    done: Callable[[Answer], None]
    """Called with the answer, once, by whichever thread has it first."""

    def answer_in(self, view: door_view.DoorView) -> Answer | None:
        """Return the answer that the doors as they are give; None: wait on."""
        try:
            return Answer(value=True) if view.door(self.door).state is self.state else None
        except errors.UnknownDoorError as error:
            return Answer(value=False, reason=str(error))


class Waits:
    """All that wait; may be used by several threads."""

    def __init__(self) -> None:
        self._waiting: set[Wait] = set()
        self._mutex = threading.Lock()

    def add(self, wait: Wait) -> None:
        """Let it wait; who adds it looks at the doors as they are after that."""
        with self._mutex:
            self._waiting.add(wait)

    def doors(self) -> set[str]:
        """Return the doors that are waited for, as they were called."""
        with self._mutex:
            return {wait.door for wait in self._waiting}

    def look(self, view: door_view.DoorView) -> None:
        """Answer those that need to wait no longer."""
        with self._mutex:
            waiting = list(self._waiting)
        for wait in waiting:
            answer = wait.answer_in(view)
            if answer is not None:
                self.end(wait, answer)

    def end(self, wait: Wait, answer: Answer) -> None:
        """Answer it, unless it was answered."""
        with self._mutex:
            if wait not in self._waiting:
                return
            self._waiting.remove(wait)
        wait.done(answer)


ACTOR = "planner"


class QueriedDoors(Protocol):
    """The doors that planners ask about: a `DoorServer`, or a `DoorFollower`."""

    @property
    def log(self) -> DoorLog:
        """The log, with all that is written now."""

    def door_map(self) -> DoorMap:
        """Return the doors as they are now."""

    def append(
        self,
        make: Callable[[DoorLogWriter], list[Event]],
        *,
        note: Note,
        command_id: bytes,
        content: bytes,
    ) -> int | None:
        """Append what `make` gives, once, as one commit that lasts."""


def act(doors: QueriedDoors, asked: parsed_questions.ParsedQuestion, client: str = "") -> None:
    """Do an action; when this returns, it is as durable as the log promises.

    What the map is already needs no event. With a command id one is stored all the same: sent
    again, later, the command must be known.

    Args:
        doors: Of the log.
        asked: An action.
        client: Who asks, for the note.

    Raises:
        SemmapError: It is not done, or nobody knows; the message says why.
    """
    name = asked.question.name
    given = asked.command_id
    note = Note(
        actor=ACTOR,
        source=f"{name} from {client}" if client else name,
        correlation="" if given is None else given.hex(),
    )
    doors.append(
        lambda log: _events(log, asked),
        note=note,
        command_id=os.urandom(16) if given is None else given,
        content=content_of(name, asked.doors, asked.number),
    )


def _events(log: DoorLogWriter, asked: parsed_questions.ParsedQuestion) -> list[Event]:
    """Return what an action means for the log as it stands; the log is held meanwhile."""
    door = door_view.DoorView(log.door_map()).door(asked.doors[0])
    happened_ns = when_ns(log)
    if asked.question.name == "REMOVE_DOOR":
        return [DoorRemoved(door_id=door.door_id, happened_ns=happened_ns)]
    changed, field, value = _set_by(asked)
    if getattr(door, field) == value and asked.command_id is None:
        return []
    values: dict[str, Any] = {field: value}
    return [
        DoorUpdated(
            door_id=door.door_id,
            changed=changed,
            level=door.level,
            happened_ns=happened_ns,
            **values,
        )
    ]


def _set_by(asked: parsed_questions.ParsedQuestion) -> tuple[Changed, str, DoorState | float]:
    """Return the part of a door that an action sets, its field, and what it becomes.

    Raises:
        CommandError: A probability that is none.
    """
    changed, field, value = _SETS[asked.question.name]
    if value is not None:
        return changed, field, value
    if not 0 <= asked.number <= 1:  # neither is NaN
        raise errors.CommandError(f"expected a probability from 0 to 1, got {asked.number!r}.")
    return changed, field, asked.number


_SETS: Mapping[str, tuple[Changed, str, DoorState | None]] = {
    "SET_DOOR_OPEN": (Changed.STATE, "state", DoorState.OPEN),
    "SET_DOOR_CLOSED": (Changed.STATE, "state", DoorState.CLOSED),
    "SET_OPEN_PROBABILITY": (Changed.PROB_OPEN, "prob_open", None),
    "SET_CLOSED_PROBABILITY": (Changed.PROB_CLOSED, "prob_closed", None),
}
"""Action -> part, field and value; None: the number in the action."""
