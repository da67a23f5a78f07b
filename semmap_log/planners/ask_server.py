"""Takes questions of many clients over a socket, and gives each its answers in order.

One thread waits for all clients and answers what takes no time. Actions, and questions that read
the log, are done by others; a client that waits, sleeps or floods holds up nobody but itself.
"""

from __future__ import annotations

import contextlib
import errno
import heapq
import os
import resource
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
from semmap_log.planners.connection import Broken, Connection
from semmap_log.planners.oracle import ENDS, Oracle, is_wait, time_is_over
from semmap_log.planners.question_lines import (
    Answer,
    Line,
    LineError,
    read_line,
    too_long,
    write_answer,
    write_error,
)
from semmap_log.planners.questions import QuestionKind
from semmap_log.planners.tokens import TOKEN, is_token

MOST_CLIENTS = 1000
OTHER_FILES = 200
"""Open files that are no clients: the log's, and what else the process has."""
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

_NO_TOKEN = f"expected {TOKEN} and the server's token first"

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
        self._most_clients = most_clients
        self._selector = selectors.DefaultSelector()
        self._connections: set[Connection] = set()
        self._ready: deque[Connection] = deque()
        """Clients with lines that were not looked at yet, though they could be."""
        self._deadlines: list[tuple[float, int, Connection]] = []
        self._count = 0
        self._answers: deque[tuple[Connection, bytes]] = deque()
        """What other threads have found."""
        self._known_lines: dict[bytes, Line] = {}
        self._ending = False
        self._failure: Exception | None = None
        self._actions = ThreadPoolExecutor(ACTIONS_AT_ONCE, "ask-action")
        self._look_ups = ThreadPoolExecutor(LOOK_UPS_AT_ONCE, "ask-look-up")
        self._waker, self._woken = socket.socketpair()
        self._is_woken = False
        self._spare: int | None = None
        _allow_files(most_clients + OTHER_FILES)
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
        self._wake()
        self._thread.join()
        self._actions.shutdown()
        self._look_ups.shutdown()
        self._waker.close()

    def _run(self) -> None:
        """Serve until the end."""
        try:
            self._serve_all()
        except Exception as error:  # noqa: BLE001  whoever runs the server must hear of it
            self._failure = error
            self._say(traceback.format_exc())
        finally:
            self._listener.close()

    def _serve_all(self) -> None:
        """Wait for clients, and serve them in turns."""
        self._spare = os.open(os.devnull, os.O_RDONLY)
        self._listener.socket.setblocking(False)
        self._woken.setblocking(False)
        self._selector.register(self._listener.socket, _READ, self._accept)
        self._selector.register(self._woken, _READ, self._sleep_again)
        while not self._ending:
            self._turn(self._next_deadline())
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
        for _ in range(len(self._ready)):
            self._serve(self._ready.popleft(), 0)
        self._meet_deadlines()

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
            self._ready.append(connection)
        if connection.is_done:
            self._drop(connection)
            return
        wanted = (_READ if connection.wants_more else 0) | (_WRITE * connection.has_answers)
        if wanted == connection.watched:
            return
        if not wanted:
            self._selector.unregister(connection.socket)
        elif connection.watched:
            self._selector.modify(connection.socket, wanted, connection)
        else:
            self._selector.register(connection.socket, wanted, connection)
        connection.watched = wanted

    def _take(self, connection: Connection, data: bytes | Broken) -> None:
        """Answer a line, or have it answered."""
        if connection.is_leaving:
            return
        if isinstance(data, Broken):
            problem = too_long() if data is Broken.TOO_LONG else "expected a line end, got none"
            connection.answer(write_error(problem))
            return
        if not connection.is_known:
            self._check_token(connection, data)
            return
        line: Line | None = None
        try:
            line = self._known_lines.get(data) or self._read(data)
            answer = self._oracle.at_once(line.asked)
        except (SemmapError, OSError) as error:
            connection.answer(_problem(line or error, str(error)))
            return
        if answer is not None:
            connection.answer(write_answer(line, answer))
        else:
            connection.is_busy = True
            self._begin(connection, line)

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
            connection.end_wait = lambda: end(ENDS)
            self._set_deadline(connection, asked.number, lambda: end(time_is_over(asked)))
            return
        pool = self._actions if asked.question.kind is QuestionKind.ACTION else self._look_ups
        pool.submit(self._answer, connection, line)

    def _answer(self, connection: Connection, line: Line) -> None:
        """Answer a question, in a thread of its own."""
        try:
            answer: Answer = self._oracle.answer(line.asked, connection.client)
            said = write_answer(line, answer)
        except (SemmapError, OSError) as error:
            said = _problem(line, str(error))
        except Exception as error:  # noqa: BLE001  the client waits for an answer, whatever it is
            self._say(f"{line.asked.question.name}: {traceback.format_exc()}")
            said = _problem(line, f"{type(error).__name__}: {error}")
        self._post(connection, said)

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
        for _ in range(LINES_A_TURN):
            try:
                connected, _ = self._listener.socket.accept()
            except BlockingIOError:
                return
            except OSError as error:
                if error.errno in (errno.EMFILE, errno.ENFILE):
                    self._refuse_by_spare()
                    return
                continue  # that one has gone again
            if len(self._connections) >= self._most_clients:
                _refuse(connected, f"{self._most_clients:,} clients are here; come later")
                continue
            connection = Connection(connected, is_known=self._token is None)
            self._connections.add(connection)
            if not connection.is_known:
                self._set_deadline(connection, TOKEN_WITHIN_S, partial(self._send_off, connection))
            self._watch(connection)

    def _refuse_by_spare(self) -> None:
        """Tell one client that no more files can be open: it takes one that was kept for that."""
        if self._spare is not None:
            os.close(self._spare)
            self._spare = None
        with contextlib.suppress(OSError):
            connected, _ = self._listener.socket.accept()
            _refuse(connected, "the server cannot open more files; come later")
        with contextlib.suppress(OSError):
            self._spare = os.open(os.devnull, os.O_RDONLY)

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

    def _set_deadline(
        self, connection: Connection, seconds: float, at_deadline: Callable[[], None]
    ) -> None:
        connection.deadline_s = time.monotonic() + seconds
        connection.at_deadline = at_deadline
        self._count += 1  # no two are alike, and connections cannot be compared
        heapq.heappush(self._deadlines, (connection.deadline_s, self._count, connection))
        if len(self._deadlines) > 2 * len(self._connections) + 64:  # most are over before their end
            self._deadlines = [each for each in self._deadlines if each[2].deadline_s == each[0]]
            heapq.heapify(self._deadlines)

    def _next_deadline(self) -> float | None:
        """Return for how many seconds nothing has to be done; None: for ever."""
        if not self._deadlines:
            return None
        return max(self._deadlines[0][0] - time.monotonic(), 0.0)

    def _meet_deadlines(self) -> None:
        while self._deadlines and self._deadlines[0][0] <= time.monotonic():
            deadline_s, _, connection = heapq.heappop(self._deadlines)
            if connection.deadline_s == deadline_s:
                connection.deadline_s = None
                connection.at_deadline()

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
        self._woken.close()
        if self._spare is not None:
            os.close(self._spare)


def _problem(of: Line | BaseException, problem: str) -> bytes:
    """Return the answer to a line that has none, in the form that it was asked in."""
    if isinstance(of, (Line, LineError)):
        return write_error(problem, is_json=of.is_json, given_id=of.given_id)
    return write_error(problem)


def _refuse(connected: socket.socket, problem: str) -> None:
    """Tell a client why it is not let in."""
    with connected, contextlib.suppress(OSError):
        connected.setblocking(False)
        connected.send(write_error(problem))


def _allow_files(count: int) -> None:
    """Let the process have so many files open, as far as the system lets it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = count if hard == resource.RLIM_INFINITY else min(count, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
