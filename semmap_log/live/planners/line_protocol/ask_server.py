"""Takes questions of many clients over a socket, and gives each its answers in order.

One thread waits for all clients and answers what takes no time. Actions, questions that read the
log, and lines that are long to read, are done by others, by turns; a client that waits, sleeps or
floods holds up nobody but itself.
"""

from __future__ import annotations

import contextlib
import selectors
import socket
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from semmap_log.errors import SemmapError
from semmap_log.live.planners.addresses import Listener
from semmap_log.live.planners.line_protocol.connection import (
    Admission,
    Broken,
    Connection,
    Deadlines,
    Turns,
)
from semmap_log.live.planners.line_protocol.tokens import TOKEN, is_token
from semmap_log.live.planners.oracle import ENDS, Oracle, is_likely, is_wait, time_is_over
from semmap_log.live.planners.parsed_questions import QuestionKind
from semmap_log.live.planners.question_lines import (
    Line,
    LineError,
    read_line,
    write_answer,
    write_error,
)

MOST_CLIENTS = 1000
ACTIONS_AT_ONCE = 8
"""They share the syncs of their commits."""
TURN_S = 0.01
"""In each turn, waiting clients share this time; a line of each is answered in any case."""
SHORT_LINE = 2**10
"""Bytes of a line that is read at once; to read a longer one may take milliseconds."""
MOST_KNOWN_LINES = 4096
MOST_KNOWN_BYTES = 200
TOKEN_WITHIN_S = 10.0
CLOSE_WITHIN_S = 5.0
"""For clients to take their last answers."""
UNHEARD_S = 5.0
"""How often it is looked whether clients are there that nothing is heard of meanwhile."""

_NO_TOKEN = f"expected {TOKEN} and the server's token first; `ask --token-file FILE` sends it"

_READ, _WRITE = selectors.EVENT_READ, selectors.EVENT_WRITE


class AskServer:
    """Answers questions until it is closed."""

    def __init__(
        self,
        oracle: Oracle,
        listener: Listener,
        *,
        token: str | None = None,
        say: Callable[[str], object] = lambda _: None,
        most_clients: int = MOST_CLIENTS,
    ) -> None:
        """Begin; the listener is closed with the server.

        Args:
            oracle: Knows the answers.
            listener: Where clients come.
            token: What each has to give first; None: nothing.
            say: Called with errors of our own.
            most_clients: Others have to come back later.
        """
        self._oracle = oracle
        self._listener = listener
        self._token = token
        self._say = say
        self._selector = selectors.DefaultSelector()
        self._connections: set[Connection] = set()
        self._ready: dict[Connection, None] = {}
        """Clients with lines that were not looked at yet, though they could be."""
        self._unheard: set[Connection] = set()
        """Clients that wait for an answer, and have more to ask: their events are not watched."""
        self._check_unheard_s = 0.0
        self._deadlines = Deadlines()
        self._slice_s = TURN_S
        """How long lines of one client are answered in this turn."""
        self._found: deque[tuple[Connection, bytes | Line]] = deque()
        """What other threads have found: answers, and the questions on long lines."""
        self._known_lines: dict[bytes, Line] = {}
        self._ending = False
        self._failure: Exception | None = None
        self._actions = ThreadPoolExecutor(ACTIONS_AT_ONCE, "ask-action")
        self._reading = Turns("ask-reading", rest=1.0)
        self._look_ups = Turns("ask-look-up")
        self._forecasts = Turns("ask-forecast")
        """What is likely takes many times longer to compute than what was so."""
        self._turns = (self._reading, self._look_ups, self._forecasts)
        self._waker, self._woken = socket.socketpair()
        self._is_woken = False
        self._admission = Admission(listener.socket, most_clients)
        self._thread = threading.Thread(target=self._run, name="ask", daemon=True)
        self._thread.start()

    @property
    def failure(self) -> Exception | None:
        """Why it answers nobody any more; None: it does."""
        return self._failure

    @property
    def address(self) -> str:
        """Where it listens."""
        return str(self._listener.address)

    def close(self) -> None:
        """Take no more questions, finish those that were begun, and leave."""
        self._ending = True
        if self._thread.is_alive():
            self._wake()
        self._thread.join()
        self._actions.shutdown()
        for turns in self._turns:
            turns.close()
        self._waker.close()  # not before: whoever still has an answer wakes us
        self._woken.close()

    def _run(self) -> None:
        """Serve until the end."""
        try:
            self._serve_all()
        except Exception as error:  # noqa: BLE001  whoever runs the server must hear of it
            self._failure = error
            self._say(traceback.format_exc())
            for connection in self._connections:
                connection.socket.close()
        finally:
            self._listener.close()

    def _serve_all(self) -> None:
        """Wait for clients, and serve them in turns."""
        self._woken.setblocking(False)
        self._selector.register(self._listener.socket, _READ, self._accept)
        self._selector.register(self._woken, _READ, self._sleep_again)
        while not self._ending:
            self._turn(self._next_s())
        self._finish()

    def _turn(self, timeout_s: float | None) -> None:
        """Do what there is to do now, for everybody once."""
        selected = self._selector.select(0 if self._ready else timeout_s)
        ready, self._ready = self._ready, {}
        self._slice_s = TURN_S / max(len(selected) + len(ready), 1)
        for key, events in selected:
            if isinstance(key.data, Connection):
                self._serve(key.data, events)
            else:
                key.data()
        for _ in range(len(self._found)):
            self._give(*self._found.popleft())
        for connection in ready:
            self._serve(connection, 0)
        self._deadlines.meet()
        self._check_unheard()

    def _next_s(self) -> float | None:
        """Return for how many seconds there is nothing to do; None: for ever."""
        next_s = self._deadlines.next_s()
        if not self._unheard:
            return next_s
        check_s = max(self._check_unheard_s - time.monotonic(), 0.0)
        return check_s if next_s is None else min(check_s, next_s)

    def _check_unheard(self) -> None:
        """Let go of clients that have gone in a way that nobody hears: what they wait for too."""
        if not self._unheard or time.monotonic() < self._check_unheard_s:
            return
        for connection in [each for each in self._unheard if each.is_abandoned()]:
            self._drop(connection)
        self._check_unheard_s = time.monotonic() + UNHEARD_S

    def _serve(self, connection: Connection, events: int) -> None:
        """Take what a client sends, answer its next lines, and give it what it takes."""
        if connection.is_gone:
            return
        try:
            if events & _READ:
                connection.receive()
                if connection.has_ended and connection.is_abandoned():
                    self._drop(connection)
                    return
            end_s = time.monotonic() + self._slice_s
            while connection.lines and not (connection.is_busy or connection.is_full):
                self._take(connection, connection.lines.popleft())
                if time.monotonic() >= end_s:
                    break
            connection.send()
        except OSError:  # it has gone
            self._drop(connection)
            return
        self._watch(connection)

    def _watch(self, connection: Connection) -> None:
        """Wait for what a client does next; let go of one with which all is done."""
        waits = connection.is_busy or connection.is_full
        if connection.lines and not waits:
            self._ready[connection] = None
        if connection.is_done:
            self._drop(connection)
            return
        wanted = (_READ if connection.wants_more else 0) | (_WRITE * connection.has_answers)
        if wanted == connection.watched:
            return
        if not wanted:
            self._selector.unregister(connection.socket)
            self._unheard.add(connection)
        elif connection.watched:
            self._selector.modify(connection.socket, wanted, connection)
        else:
            self._selector.register(connection.socket, wanted, connection)
            self._unheard.discard(connection)
        connection.watched = wanted

    def _take(self, connection: Connection, data: bytes | Broken) -> None:
        """Answer a line, or have it answered."""
        if connection.is_leaving:
            return
        if isinstance(data, Broken):
            connection.answer(write_error(data.problem, is_json=data.is_json))
            return
        if not connection.is_known:
            self._check_token(connection, data)
            return
        if len(data) > SHORT_LINE:
            connection.is_busy = True
            self._reading.add(connection, self._read_by_turns(connection, data))
            return
        try:
            line = self._known_lines.get(data) or self._read(data)
        except Exception as error:  # noqa: BLE001  the others are still to be answered
            connection.answer(self._refusal(error, error))
        else:
            self._answer_line(connection, line)

    def _answer_line(self, connection: Connection, line: Line) -> None:
        """Answer a question, or have it answered."""
        try:
            answer = self._oracle.at_once(line.asked)
            if answer is not None:
                connection.answer(write_answer(line, answer))
            else:
                self._begin(connection, line)
        except Exception as error:  # noqa: BLE001  as above
            connection.answer(self._refusal(line, error))

    def _read_by_turns(self, connection: Connection, data: bytes) -> Iterator[None]:
        """Read a long line, in another thread: one part of its work."""
        yield from ()
        try:
            found: bytes | Line = read_line(data.removesuffix(b"\r"))
        except Exception as error:  # noqa: BLE001  the client waits for an answer, whatever it is
            found = self._refusal(error, error)
        self._post(connection, found)

    def _read(self, data: bytes) -> Line:
        """Return the question on a line; those without a command id are likely to come again."""
        line = read_line(data.removesuffix(b"\r"))
        if line.asked.command_id is None and len(data) <= MOST_KNOWN_BYTES:
            if len(self._known_lines) >= MOST_KNOWN_LINES:
                self._known_lines.clear()
            self._known_lines[data] = line
        return line

    def _check_token(self, connection: Connection, data: bytes) -> None:
        assert self._token is not None
        if is_token(data, self._token):
            connection.is_known, connection.deadline_s = True, None
            connection.answer(b"T\n")
        else:
            connection.answer(write_error(_NO_TOKEN))
            connection.is_leaving = True

    def _send_off(self, connection: Connection) -> None:
        """Disconnect a client that has not given its token in time."""
        connection.answer(write_error(_NO_TOKEN))
        connection.is_leaving = True
        self._serve(connection, 0)

    def _begin(self, connection: Connection, line: Line) -> None:
        """Have a question answered that takes time."""
        asked = line.asked
        if is_wait(asked):
            end = self._oracle.wait(
                asked, lambda answer: self._post(connection, write_answer(line, answer))
            )
            connection.is_busy = True
            connection.end_wait = lambda: end(ENDS)
            self._deadlines.set(connection, asked.number, lambda: end(time_is_over(asked)))
            return
        connection.is_busy = True
        work = self._answer_by_parts(connection, line)
        if asked.question.kind is QuestionKind.ACTION:
            self._actions.submit(list, work)  # an action is one part
        else:
            (self._forecasts if is_likely(asked) else self._look_ups).add(connection, work)

    def _answer_by_parts(self, connection: Connection, line: Line) -> Iterator[None]:
        """Answer a question, part by part, in another thread."""
        said = _problem(line, "the server ends")
        try:
            for answer in self._oracle.steps(line.asked, connection.client):
                if answer is not None:
                    said = write_answer(line, answer)
                if answer is not None or self._ending:
                    break
                yield
        except Exception as error:  # noqa: BLE001  the client waits for an answer, whatever it is
            said = self._refusal(line, error)
        self._post(connection, said)

    def _refusal(self, of: Line | Exception, error: Exception) -> bytes:
        """Return the answer where there is none; report it to the server's console if we failed."""
        if isinstance(error, (SemmapError, OSError)):
            return _problem(of, str(error))
        self._say(traceback.format_exc())
        return _problem(of, f"{type(error).__name__}: {error}")

    def _post(self, connection: Connection, found: bytes | Line) -> None:
        """Have the server's own thread give an answer, or answer what was read."""
        self._found.append((connection, found))
        self._wake()

    def _give(self, connection: Connection, found: bytes | Line) -> None:
        """Give an answer that took time; answer a question that took time to read."""
        if connection.is_gone:
            return
        connection.is_busy, connection.deadline_s = False, None
        if isinstance(found, bytes):
            connection.answer(found)
        elif not connection.is_leaving:
            self._answer_line(connection, found)
        self._serve(connection, 0)

    def _wake(self) -> None:
        if not self._is_woken:
            self._is_woken = True
            self._waker.send(b"!")

    def _sleep_again(self) -> None:
        with contextlib.suppress(BlockingIOError):
            self._woken.recv(4096)
        self._is_woken = False  # before what was posted is looked at

    def _accept(self) -> None:
        """Let in who waits at the door."""
        for connected in self._admission.admitted(len(self._connections)):
            connection = Connection(connected, is_known=self._token is None)
            self._connections.add(connection)
            if not connection.is_known:
                self._deadlines.set(connection, TOKEN_WITHIN_S, partial(self._send_off, connection))
            self._watch(connection)

    def _drop(self, connection: Connection) -> None:
        """Let go of a client; an action that it has begun is finished all the same."""
        if connection.is_gone:
            return
        connection.is_gone, connection.deadline_s = True, None
        connection.end_wait()
        if connection.watched:
            self._selector.unregister(connection.socket)
        connection.socket.close()
        self._connections.discard(connection)
        self._unheard.discard(connection)

    def _finish(self) -> None:
        """Give the answers to what was begun, as long as clients take them, and let all go."""
        self._selector.unregister(self._listener.socket)
        self._listener.close()
        for connection in self._connections:
            connection.is_leaving = True  # after this nothing is begun
            connection.lines.clear()
            connection.end_wait()
        self._ready.clear()
        for connection in list(self._connections):
            self._serve(connection, 0)
        end_s = time.monotonic() + CLOSE_WITHIN_S
        while self._connections and (
            time.monotonic() < end_s or any(each.is_busy for each in self._connections)
        ):
            self._turn(max(min(end_s - time.monotonic(), 0.5), 0.05))
        for connection in list(self._connections):
            self._drop(connection)
        self._selector.close()
        self._admission.close()


def _problem(of: Line | Exception, problem: str) -> bytes:
    """Return the answer to a line that has none, in the form of the question."""
    if isinstance(of, (Line, LineError)):
        return write_error(problem, is_json=of.is_json, given_id=of.given_id)
    return write_error(problem)
