"""Takes questions of many clients over a socket, and gives each its answers in order.

One thread waits for all clients and answers what takes no time. Actions, and questions that read
the log, are done by others; a client that waits, sleeps or floods holds up nobody but itself.
"""

from __future__ import annotations

import contextlib
import selectors
import socket
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from semmap_log.errors import SemmapError
from semmap_log.planners.addresses import Listener
from semmap_log.planners.line_protocol.admission import Admission
from semmap_log.planners.line_protocol.connection import Broken, Connection
from semmap_log.planners.line_protocol.deadlines import Deadlines
from semmap_log.planners.line_protocol.tokens import TOKEN, is_token
from semmap_log.planners.oracle import ENDS, Oracle, is_wait, time_is_over
from semmap_log.planners.question_lines import (
    Answer,
    Line,
    LineError,
    read_line,
    write_answer,
    write_error,
)
from semmap_log.planners.questions import QuestionKind

MOST_CLIENTS = 1000
ACTIONS_AT_ONCE = 8
"""They share the syncs of their commits."""
LOOK_UPS_AT_ONCE = 2
LINES_A_TURN = 64
"""Of one client, before the others have theirs."""
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
            say: Is told of errors of our own.
            most_clients: More are told to come later.
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
        """Clients that wait for an answer, and have asked more: none of their events is watched."""
        self._check_unheard_s = 0.0
        self._deadlines = Deadlines()
        self._answers: deque[tuple[Connection, bytes]] = deque()
        """What other threads have found."""
        self._known_lines: dict[bytes, Line] = {}
        self._ending = False
        self._failure: Exception | None = None
        self._actions = ThreadPoolExecutor(ACTIONS_AT_ONCE, "ask-action")
        self._look_ups = ThreadPoolExecutor(LOOK_UPS_AT_ONCE, "ask-look-up")
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
        self._look_ups.shutdown()
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
        for key, events in self._selector.select(0 if self._ready else timeout_s):
            if isinstance(key.data, Connection):
                self._serve(key.data, events)
            else:
                key.data()
        while self._answers:
            self._give(*self._answers.popleft())
        ready, self._ready = self._ready, {}
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
            left = LINES_A_TURN
            while connection.lines and left and not (connection.is_busy or connection.is_full):
                left -= 1
                self._take(connection, connection.lines.popleft())
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
        line: Line | None = None
        try:
            line = self._known_lines.get(data) or self._read(data)
            answer = self._oracle.at_once(line.asked)
            if answer is not None:
                connection.answer(write_answer(line, answer))
            else:
                self._begin(connection, line)
        except (SemmapError, OSError) as error:
            connection.answer(_problem(line or error, str(error)))
        except Exception as error:  # noqa: BLE001  the others are still to be answered
            connection.answer(self._own_problem(line or error, error))

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
        """Let go of a client that has not said in time who it is."""
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
        pool = self._actions if asked.question.kind is QuestionKind.ACTION else self._look_ups
        pool.submit(self._answer, connection, line)
        connection.is_busy = True

    def _answer(self, connection: Connection, line: Line) -> None:
        """Answer a question, in a thread of its own."""
        try:
            answer: Answer = self._oracle.answer(line.asked, connection.client)
            said = write_answer(line, answer)
        except (SemmapError, OSError) as error:
            said = _problem(line, str(error))
        except Exception as error:  # noqa: BLE001  the client waits for an answer, whatever it is
            said = self._own_problem(line, error)
        self._post(connection, said)

    def _own_problem(self, of: Line | BaseException, error: Exception) -> bytes:
        """Return the answer where we have failed, and tell who runs the server how."""
        self._say(traceback.format_exc())
        return _problem(of, f"{type(error).__name__}: {error}")

    def _post(self, connection: Connection, said: bytes) -> None:
        """Have an answer given by the server's own thread."""
        self._answers.append((connection, said))
        self._wake()

    def _give(self, connection: Connection, said: bytes) -> None:
        """Give an answer that took time."""
        if connection.is_gone:
            return
        connection.is_busy, connection.deadline_s = False, None
        connection.answer(said)
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


def _problem(of: Line | BaseException, problem: str) -> bytes:
    """Return the answer to a line that has none, in the form that it was asked in."""
    if isinstance(of, (Line, LineError)):
        return write_error(problem, is_json=of.is_json, given_id=of.given_id)
    return write_error(problem)
