"""Questions of OPRS kernels, and their answers.

    (ASK 17 (DOOR_OPEN DOOR_3))         (ANSWER 17 T)
    (ASK K1-18 (GET_OPEN_DOOR $X))      (ANSWER K1-18 DOOR_3)
    (ASK "a" (DOORS OPEN))              (ANSWER "a" (. DOOR_1 DOOR_3 .))
    (ASK 19 (DOR_OPEN DOOR_3))          (ANSWER 19 (ERROR "'DOR_OPEN' is no question. ..."))

One kernel's questions are answered in their order, but for WAIT_UNTIL, which holds up nothing. An
action that comes again within a minute, from the same kernel, with the same ask-id and the same
words, is answered as the first time, and not done again, even if the server was killed between.
"""

from __future__ import annotations

import contextlib
import hashlib
import threading
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Protocol, TypeAlias

from semmap_log.errors import ExpressionError, QuestionError, SemmapError
from semmap_log.live.planners.asked import AskedQuestion, QuestionKind, read_words
from semmap_log.live.planners.kernels.s_expressions import (
    Expression,
    Variable,
    flat,
    sendable,
    write_expression,
)
from semmap_log.live.planners.oracle import ENDS, AskedDoors, Oracle, is_wait, time_is_over
from semmap_log.live.planners.question_lines import ERROR, NIL, TRUE, Answer, Atom, Value
from semmap_log.log.door_log.door_log_writer import DoorLogWriter

ASK, ANSWER = Atom("ASK"), Atom("ANSWER")

REPEATED_WITHIN_NS = 60 * 10**9
"""An action of the same ask-id is the same command for so long, and for twice as long at most."""

MOST_QUESTIONS = 10_000
"""Of one kernel, that wait for their turn."""
MOST_WAITS = 1000
AT_ONCE = 4
"""Kernels whose actions and long questions are worked on; their commits share syncs."""

AskId: TypeAlias = "Atom | str | int"


class Asker(Protocol):
    """Who answers go to, as long as the connection lasts."""

    def give(self, kernel: str, answer: tuple[Expression, ...]) -> None:
        """Send an answer; any thread may."""

    def wake(self) -> None:
        """Look at what there is to do; any thread may call this."""

    def later(self, question: KernelQuestion) -> None:
        """Have `KernelQuestions.end_wait` called once its seconds are over."""


@dataclass(frozen=True, slots=True, eq=False)
class KernelQuestion:
    """A question, its sender, and the mark by which its answer is recognised."""

    asker: Asker
    kernel: str
    ask_id: AskId
    asked: AskedQuestion
    command_ids: tuple[bytes, bytes]
    """Of an action: what it is known by now, and was a minute ago."""

    def give(self, answer: Answer) -> None:
        """Answer it."""
        self.asker.give(self.kernel, (ANSWER, self.ask_id, expression_of(answer.value)))

    def refuse(self, problem: str) -> None:
        """Say why it cannot be answered."""
        self.asker.give(self.kernel, refusal(self.ask_id, problem))


def ask_id_of(expression: tuple[Expression, ...]) -> AskId:
    """Return by what the answer to a question is to be known.

    Raises:
        ExpressionError: There is nothing by which it can be.
    """
    ask_id = expression[1] if len(expression) > 1 else None
    if not isinstance(ask_id, (str, int)) or isinstance(ask_id, Variable):
        raise ExpressionError("expected (ASK id (QUESTION ...)), the id an atom, number or text.")
    write_expression((ANSWER, ask_id))
    return ask_id


def question_of(expression: tuple[Expression, ...]) -> AskedQuestion:
    """Return the question.

    Raises:
        QuestionError: It cannot be understood.
    """
    words = flat(expression[2:])
    if words and words[0] in _BIND:
        words = [word for word in words if not isinstance(word, Variable)]
    for word in words:
        if isinstance(word, Variable):
            raise QuestionError(f"expected a value, got the variable {word}, which has none")
    return read_words(words)


_BIND = ("GET_OPEN_DOOR", "GET_CLOSED_DOOR")
"""The thesis gives these a variable to bind; here the answer is the door."""


def expression_of(value: Value) -> Expression:
    """Return the value of an answer as kernels take it."""
    if value is True:
        return Atom(TRUE)
    if value is None or value is False:
        return Atom(NIL)
    if isinstance(value, (Atom, int, float)):
        return value
    if isinstance(value, str):
        return sendable(value)
    return [expression_of(each) for each in value]


def refusal(ask_id: AskId, problem: str) -> tuple[Expression, ...]:
    """Return the answer to a question that cannot be answered."""
    return ANSWER, ask_id, (Atom(ERROR), sendable(problem))


def command_ids(kernel: str, words: Sequence[Expression], now_ns: int) -> tuple[bytes, bytes]:
    """Return the command ids of a requested action: of this minute, and of the last.

    Args:
        kernel: Who asks.
        words: All of its message.
        now_ns: When.
    """
    minute = now_ns // REPEATED_WITHIN_NS
    one, other = (
        hashlib.sha256(f"semmap-log/oprs {(kernel, *words, each)!r}".encode()).digest()[:16]
        for each in (minute, minute - 1)
    )
    return one, other


class KernelQuestions:
    """Answers kernels' questions until it is closed."""

    def __init__(
        self,
        oracle: Oracle,
        doors: AskedDoors,
        *,
        say: Callable[[str], object],
        clock_ns: Callable[[], int],
    ) -> None:
        """Begin.

        Args:
            oracle: Knows the answers.
            doors: What the questions are about.
            say: Called with errors of our own.
            clock_ns: The time, by which actions that are soon repeated are recognised.
        """
        self._oracle = oracle
        self._doors = doors
        self._say = say
        self._clock_ns = clock_ns
        self._pool = ThreadPoolExecutor(AT_ONCE, "oprs-question")
        self._mutex = threading.Lock()
        self._queues: dict[tuple[int, str], deque[KernelQuestion]] = {}
        self._waits: dict[KernelQuestion, Callable[[Answer], None]] = {}
        """Question -> what ends its waiting."""
        self._acting = 0

    @property
    def is_acting(self) -> bool:
        """Whether an action is worked on that is not answered yet."""
        return self._acting > 0

    def ask(self, asker: Asker, kernel: str, expression: tuple[Expression, ...]) -> None:
        """Have a question answered; this takes no time.

        Raises:
            ExpressionError: There is nothing by which an answer could be known.
        """
        ask_id = ask_id_of(expression)
        try:
            asked = question_of(expression)
            ids = command_ids(kernel, flat(expression), self._clock_ns())
        except SemmapError as error:
            asker.give(kernel, refusal(ask_id, str(error)))
            return
        question = KernelQuestion(asker, kernel, ask_id, asked, ids)
        try:
            if is_wait(asked):
                self._wait(question)
            else:
                self._take(question)
        except Exception as error:  # noqa: BLE001  the others are still to be answered
            self._own_problem(question, error)

    def forget(self, asker: Asker) -> None:
        """Drop a sender's questions that were not begun: nobody receives the answers."""
        with self._mutex:
            for key in [key for key in self._queues if key[0] == id(asker)]:
                self._queues[key].clear()
            ends = [end for each, end in self._waits.items() if each.asker is asker]
        for end in ends:
            end(ENDS)

    def waits(self, question: KernelQuestion) -> bool:
        """Return whether a question waits for its door."""
        return question in self._waits

    def end_wait(self, question: KernelQuestion) -> None:
        """Answer a question whose time is over, if it still waits."""
        with self._mutex:
            end = self._waits.get(question)
        if end is not None:
            end(time_is_over(question.asked))

    def close(self) -> None:
        """Finish what was begun."""
        self._pool.shutdown()

    def _take(self, question: KernelQuestion) -> None:
        """Answer at once what takes no time, unless older questions of that kernel wait."""
        key = id(question.asker), question.kernel
        with self._mutex:
            queue = self._queues.get(key)
            if queue is not None:
                is_full = len(queue) >= MOST_QUESTIONS
                if not is_full:
                    queue.append(question)
        if queue is None:
            if self._at_once(question):
                return
            with self._mutex:
                self._queues[key] = deque([question])
            self._submit(key)
        elif is_full:
            question.refuse(f"{MOST_QUESTIONS:,} questions of {question.kernel} wait already.")

    def _at_once(self, question: KernelQuestion) -> bool:
        try:
            answer = self._oracle.at_once(question.asked)
            if answer is not None:
                question.give(answer)
        except (SemmapError, OSError) as error:
            question.refuse(str(error))
            return True
        return answer is not None

    def _work(self, key: tuple[int, str]) -> None:
        """Answer the next question of one kernel; its others wait for other kernels' turns."""
        with self._mutex:
            if not self._queues[key]:
                del self._queues[key]
                return
            question = self._queues[key].popleft()
        self._answer(question)
        self._submit(key)

    def _submit(self, key: tuple[int, str]) -> None:
        with contextlib.suppress(RuntimeError):  # it is closed: nothing more is begun
            self._pool.submit(self._work, key)

    def _answer(self, question: KernelQuestion) -> None:
        is_action = question.asked.question.kind is QuestionKind.ACTION
        self._count(is_action)
        try:
            asked = question.asked
            if is_action:
                asked = replace(asked, command_id=self._command_id(question))
            question.give(self._oracle.answer(asked, f"kernel {question.kernel}"))
        except (SemmapError, OSError) as error:
            question.refuse(str(error))
        except Exception as error:  # noqa: BLE001  the kernel waits for an answer, whatever it is
            self._own_problem(question, error)
        finally:
            self._count(-is_action)
            question.asker.wake()  # what waited for the answer may go

    def _own_problem(self, question: KernelQuestion, error: Exception) -> None:
        """Answer that we have failed, and report the error to whoever runs the server."""
        self._say(f"{question.asked.question.name}: {traceback.format_exc()}")
        question.refuse(f"{type(error).__name__}: {error}")

    def _wait(self, question: KernelQuestion) -> None:
        """Let a question wait for its door."""
        with self._mutex:
            is_full = len(self._waits) >= MOST_WAITS
            if not is_full:
                self._waits[question] = lambda _: None
        if is_full:
            question.refuse(f"{MOST_WAITS:,} questions wait already.")
            return

        def done(answer: Answer) -> None:
            with self._mutex:
                self._waits.pop(question, None)
            question.give(answer)

        try:
            end = self._oracle.wait(question.asked, done)
        except Exception:
            with self._mutex:
                del self._waits[question]
            raise
        with self._mutex:
            if question not in self._waits:  # it is answered already
                return
            self._waits[question] = end
        question.asker.later(question)

    def _count(self, actions: int) -> None:
        with self._mutex:
            self._acting += actions

    def _command_id(self, question: KernelQuestion) -> bytes:
        """Return what an action is known by: the same if it was done a minute ago."""
        now, before = question.command_ids
        log = self._doors.log
        if isinstance(log, DoorLogWriter) and log.find_command(before) is not None:
            return before
        return now


def is_ask(expression: Sequence[Expression]) -> bool:
    """Return whether a message is a question."""
    return expression[0] == ASK
