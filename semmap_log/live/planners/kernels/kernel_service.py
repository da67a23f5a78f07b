"""Serves OPRS kernels through their message passer, and reconnects when that has gone.

A session is one connection to the passer: facts go out, questions come in.
"""

from __future__ import annotations

import contextlib
import heapq
import selectors
import socket
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from semmap_log.live.planners.kernels.kernel_questions import (
    MOST_WAITS,
    KernelQuestion,
    KernelQuestions,
    is_ask,
)
from semmap_log.live.planners.kernels.message_passer import (
    CONNECT_S,
    ECHO,
    MOST_NAME_BYTES,
    PASSER,
    PasserConnection,
    ToldKernels,
    check_own_name,
    is_name,
    message,
    unknown_name,
)
from semmap_log.live.planners.kernels.s_expressions import Expression, is_atom, read_expression

from semmap_log.core.model.doors import DoorMap
from semmap_log.errors import ExpressionError, PasserError, SemmapError
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.live.planners.addresses import TcpAddress
from semmap_log.live.planners.oracle import AskedDoors, Oracle
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
    """Serves the kernels at a passer until it goes, or until it is stopped."""

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
        """Prepare a session; nothing is sent yet.

        Args:
            connection: To the passer; it is closed with the session.
            name: Ours.
            kernels: Who receives the doors.
            questions: Answers the questions.
            say: Called with messages about what cannot be understood.
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
        """Whether there may be news that was not sent, as something else goes first."""
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
        """Serve until stopped.

        Args:
            stop: Called at each turn.
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
        """Return whether the doors may be sent to kernels now; else something else goes first."""
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
            self._say("further such messages are not reported.")


def _expression_in(text: bytes) -> tuple[Expression, ...]:
    """Return the expression that a message is.

    Raises:
        ExpressionError: It is none, or longer than a question may be.
        UnicodeDecodeError: It is no UTF-8 text.
    """
    if len(text) > MOST_LINE_BYTES:
        raise ExpressionError(too_long())
    return read_expression(text.decode())


FIRST_PAUSE_S = 0.2
LONGEST_PAUSE_S = 5.0
LASTING_S = 5.0
"""A connection that has lasted so long was a good one: the next try comes soon."""


@dataclass(frozen=True, slots=True)
class Kernels:
    """Where kernels are found, and which of them receive the doors."""

    passer: TcpAddress
    name: str
    """Ours."""
    told: Sequence[str] = ()
    connect_s: float = CONNECT_S
    patience: Patience = field(default_factory=Patience)

    @property
    def where(self) -> str:
        """Where the message passer listens."""
        return str(self.passer).removeprefix("tcp:")

    def __post_init__(self) -> None:
        """Refuse names that cannot be.

        Raises:
            PasserError: One of them.
        """
        check_own_name(self.name)
        for kernel in self.told:
            if not (is_atom(kernel) and is_name(kernel)) or kernel == self.name:
                raise PasserError(
                    f"{kernel!r} cannot be the name of a kernel: expected at most "
                    f"{MOST_NAME_BYTES} letters, digits, _ and -, a letter first, and another "
                    "name than ours."
                )


class KernelService:
    """Sends the doors to kernels, and answers them, until it is closed."""

    def __init__(
        self,
        oracle: Oracle,
        doors: AskedDoors,
        kernels: Kernels,
        *,
        say: Callable[[str], object] = lambda _: None,
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        """Begin; from then on somebody has to call `wake` after each change of the doors.

        Args:
            oracle: Knows the answers.
            doors: What is sent to kernels.
            kernels: Who, and where.
            say: Called when the passer comes or goes, and about what cannot be understood.
            clock_ns: The time, by which actions that are soon repeated are recognised.
        """
        self._doors = doors
        self._kernels = kernels
        self._say = say
        self._questions = KernelQuestions(oracle, doors, say=say, clock_ns=clock_ns)
        self._session: KernelSession | None = None
        self._said = ""
        """What went wrong last: it is reported once."""
        self._has_changed = threading.Event()
        self._ending = threading.Event()
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="oprs", daemon=True)
        self._thread.start()

    @property
    def failure(self) -> Exception | None:
        """Why nothing is sent to kernels any more; None: it is."""
        return self._failure

    def wake(self) -> None:
        """Hear that the doors have changed."""
        self._has_changed.set()
        if (session := self._session) is not None:
            session.wake()

    def close(self) -> None:
        """Leave the passer; what was begun is finished."""
        self._ending.set()
        self.wake()
        self._thread.join()
        self._questions.close()

    def _run(self) -> None:
        try:
            self._serve()
        except Exception as error:  # noqa: BLE001  whoever runs the service must hear of it
            self._failure = error
            if not isinstance(error, SemmapError):
                self._say(traceback.format_exc())

    def _serve(self) -> None:
        """Serve over one connection after the other."""
        pause_s = FIRST_PAUSE_S
        while not self._ending.is_set():
            began_s = time.monotonic()
            try:
                self._serve_once()
            except PasserError as error:
                if str(error) != self._said:
                    self._said = str(error)
                    self._say(f"OPRS: {error} It is tried again.")
            if time.monotonic() - began_s > self._kernels.connect_s + LASTING_S:
                pause_s = FIRST_PAUSE_S
            self._ending.wait(pause_s)
            pause_s = min(2 * pause_s, LONGEST_PAUSE_S)

    def _serve_once(self) -> None:
        """Serve as long as the passer is there."""
        kernels = self._kernels
        connection = PasserConnection(kernels.passer, kernels.name, timeout_s=kernels.connect_s)
        self._say(f"OPRS: {kernels.name} is registered at the message passer.")
        self._said = ""
        session = KernelSession(connection, kernels.name, kernels.told, self._questions,
                                say=lambda text: self._say(f"OPRS: {text}"),
                                patience=kernels.patience)  # fmt: skip
        self._session = session
        self._has_changed.set()
        try:
            session.run(self._ending.is_set, self._changed)
        finally:
            self._session = None
            session.close()

    def _changed(self) -> DoorMap | None:
        """Return the doors where they may be others than the last time."""
        if not self._has_changed.is_set():
            return None
        self._has_changed.clear()  # before looking: what comes now is looked at again
        return self._doors.door_map()
