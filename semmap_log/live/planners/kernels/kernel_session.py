"""One connection to the message passer while it lasts: facts go out, questions come in."""

from __future__ import annotations

import contextlib
import heapq
import selectors
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from semmap_log.core.model.doors import DoorMap
from semmap_log.errors import ExpressionError, PasserError
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.live.planners.kernels.kernel_questions import (
    MOST_WAITS,
    KernelQuestion,
    KernelQuestions,
    is_ask,
)
from semmap_log.live.planners.kernels.message_passer import PasserConnection
from semmap_log.live.planners.kernels.passer_frames import PASSER, is_name, message, unknown_name
from semmap_log.live.planners.kernels.s_expressions import Expression, read_expression
from semmap_log.live.planners.kernels.told_kernels import ECHO, ToldKernels
from semmap_log.live.planners.question_lines import MOST_LINE_BYTES, too_long

MOST_WAITING_BYTES = 2**20
"""Of messages that the passer has not taken: changes of doors wait until it has."""
MOST_ANSWER_BYTES = 2**24
"""Of messages that the passer has not taken: who asks on is not answered.

Answers that take time are found later: of these, and all others, twice as much at most is kept.
"""
ANSWER_FIRST_S = 0.05
"""So long at most, while actions are worked on, facts wait for their answers.

Of two messages to a kernel in a row the second takes 40 ms: mp-oprs writes each by itself, and the
system keeps the second until the kernel's has confirmed the first. The answer is what a plan waits
for, so that it goes first.
"""
MOST_COMPLAINTS = 20
"""About messages, over one connection: who floods us must not fill the disk with them."""


@dataclass(frozen=True, slots=True)
class Patience:
    """How long a passer may be silent."""

    ask_after_s: float = 10.0
    """Then we send ourselves a message."""
    give_up_after_s: float = 40.0
    """Then the connection is as good as gone."""


class KernelSession:
    """Serves the kernels at a passer until it goes, or until told to stop."""

    def __init__(
        self,
        connection: PasserConnection,
        name: str,
        kernels: Sequence[str],
        questions: KernelQuestions,
        *,
        say: Callable[[str], object],
        patience: Patience,
    ) -> None:
        """Tell nobody anything yet.

        Args:
            connection: To the passer; it is closed with the session.
            name: Ours.
            kernels: Who is told of the doors.
            questions: Answers what is asked.
            say: Is told of messages that nobody understands.
            patience: With the passer.
        """
        self._connection = connection
        self._name = name
        self._questions = questions
        self._say = say
        self._patience = patience
        self._complaints = 0
        self._told = ToldKernels(name, kernels, connection.put)
        self._answers: deque[bytes] = deque()
        """Found by other threads."""
        self._answers_bytes = 0
        self._counting = threading.Lock()
        self._ends: list[tuple[float, int, KernelQuestion]] = []
        self._end_count = 0
        self._is_held = False
        """Whether there may be something to tell that was not, as something else goes first."""
        self._heard_s = self._asked_s = self._told_s = time.monotonic()
        self._selector = selectors.DefaultSelector()
        self._waker, self._woken = socket.socketpair()
        for end in (self._waker, self._woken):
            end.setblocking(False)
        self._selector.register(connection.socket, selectors.EVENT_READ)
        self._selector.register(self._woken, selectors.EVENT_READ)

    def wake(self) -> None:
        """Have `run` look at what there is to do; any thread may."""
        with contextlib.suppress(OSError):  # it is awake, or over
            self._waker.send(b"!")

    def run(self, stop: Callable[[], bool], changed: Callable[[], DoorMap | None]) -> None:
        """Serve until told to stop.

        Args:
            stop: Asked at each turn.
            changed: Returns the doors, where they may be others than the last time.

        Raises:
            PasserError: The passer has gone.
            LogError: The doors cannot be known any more.
        """
        while not stop():
            now_s = time.monotonic()
            self._put_answers()
            if self._may_tell(now_s):
                if (doors := changed()) is not None:
                    self._told.take(doors)
                self._told.call(now_s)
            self._check_silence(now_s)
            self._end_waits(now_s)
            self._connection.send()
            self._await(now_s)

    def give(self, kernel: str, answer: tuple[Expression, ...]) -> None:
        """Send an answer, unless too many wait already; any thread may."""
        frame = message([kernel], answer)
        if self._answers_bytes + self._connection.waiting_bytes > 2 * MOST_ANSWER_BYTES:
            self._complain(f"{kernel} is not answered, as the passer does not take our messages.")
            return
        with self._counting:
            self._answers_bytes += len(frame)
        self._answers.append(frame)
        self.wake()

    def later(self, question: KernelQuestion) -> None:
        """Have the waiting of a question ended by `run`, in whose thread this is called."""
        if len(self._ends) > 4 * MOST_WAITS:  # most were answered before their time
            self._ends = [each for each in self._ends if self._questions.waits(each[2])]
            heapq.heapify(self._ends)
        self._end_count += 1  # no two are alike: questions cannot be compared
        end_s = time.monotonic() + question.asked.number
        heapq.heappush(self._ends, (end_s, self._end_count, question))

    def close(self) -> None:
        """Leave the passer; answers that are found now go to nobody."""
        self._questions.forget(self)
        self._put_answers()
        self._selector.close()
        self._connection.close()
        self._waker.close()
        self._woken.close()

    def _put_answers(self) -> None:
        """Have the answers sent that were found."""
        while self._answers:
            frame = self._answers.popleft()
            with self._counting:
                self._answers_bytes -= len(frame)
            self._connection.put(frame)

    def _await(self, now_s: float) -> None:
        """Wait for what is to be done next, and take what has come."""
        events = selectors.EVENT_READ
        if self._connection.waiting_bytes:
            events |= selectors.EVENT_WRITE
        self._selector.modify(self._connection.socket, events)
        for key, ready in self._selector.select(max(self._next_s() - now_s, 0)):
            if key.fileobj is self._woken:
                with contextlib.suppress(BlockingIOError):
                    self._woken.recv(2**16)
            elif ready & selectors.EVENT_READ:
                for sender, text in self._connection.receive():
                    self._take(sender, text)

    def _next_s(self) -> float:
        """Return when there is something to do though nothing comes."""
        next_s = [self._asked_s + self._patience.ask_after_s]
        next_s += [self._ends[0][0]] if self._ends else []
        if not self._is_held:
            next_s += [] if self._told.next_call_s is None else [self._told.next_call_s]
        elif not self._connection.waiting_bytes:  # else it is looked at when some have gone
            next_s.append(self._told_s + ANSWER_FIRST_S)
        return min(next_s)

    def _take(self, sender: bytes, text: bytes) -> None:
        """Do what a message wants."""
        self._heard_s = time.monotonic()
        name = sender.decode(errors="replace")
        if name == PASSER:
            if (unknown := unknown_name(text)) is not None:
                self._told.is_unknown(unknown, self._heard_s)
            return
        try:
            self._understand(name, _expression_in(text))
        except (ExpressionError, PasserError, UnicodeDecodeError) as error:
            self._complain(f"{shown(name)} sent {shown(text[:60])}: {error}")

    def _understand(self, name: str, expression: tuple[Expression, ...]) -> None:
        if expression[0] == ECHO and name == self._name:
            self._told.returned(expression[-1])
            return
        if not is_name(name):
            raise PasserError(f"to {shown(name)} nothing can be sent.")
        if self._answers_bytes > MOST_WAITING_BYTES:
            self._put_answers()
            self._connection.send()
        if self._connection.waiting_bytes > MOST_ANSWER_BYTES:
            raise PasserError("it is not answered, as the passer does not take our messages.")
        self._told.is_there(name)
        if is_ask(expression):
            self._questions.ask(self, name, expression)
        elif expression == ("FACTS",):
            self._told.tell_all(name)
        else:
            raise ExpressionError("expected (ASK id (QUESTION ...)) or (FACTS).")

    def _may_tell(self, now_s: float) -> bool:
        """Tell whether kernels may be told of the doors now, or something else goes first."""
        is_slow = self._connection.waiting_bytes >= MOST_WAITING_BYTES
        is_later = self._questions.is_acting and now_s < self._told_s + ANSWER_FIRST_S
        self._is_held = is_slow or is_later
        if not self._is_held:
            self._told_s = now_s
        return not self._is_held

    def _check_silence(self, now_s: float) -> None:
        """Ask a silent passer whether it is there; one that stays silent is not."""
        if now_s - self._heard_s > self._patience.give_up_after_s:
            raise PasserError("the message passer does not answer.")
        if now_s - self._asked_s >= self._patience.ask_after_s:
            self._asked_s = now_s
            self._told.echo()

    def _end_waits(self, now_s: float) -> None:
        while self._ends and self._ends[0][0] <= now_s:
            self._questions.end_wait(heapq.heappop(self._ends)[2])

    def _complain(self, problem: str) -> None:
        self._complaints += 1
        if self._complaints <= MOST_COMPLAINTS:
            self._say(problem)
        if self._complaints == MOST_COMPLAINTS:
            self._say("more such messages are not told.")


def _expression_in(text: bytes) -> tuple[Expression, ...]:
    """Return the expression that a message is.

    Raises:
        ExpressionError: It is none, or longer than a question may be.
        UnicodeDecodeError: It is no UTF-8 text.
    """
    if len(text) > MOST_LINE_BYTES:
        raise ExpressionError(too_long())
    return read_expression(text.decode())
