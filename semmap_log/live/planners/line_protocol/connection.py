"""A server's clients: which are accepted, what each sends and gets, and whose turn it is.

Clients are accepted up to a number, as long as files can be opened; the others get the reason. Of a
client, bytes come in, lines go out, and answers may wait; deadlines say when its time is over. The
work of many clients is done in one thread by turns: the client that had least of its time is next.
"""

from __future__ import annotations

import contextlib
import errno
import heapq
import os
import resource
import select
import socket
import struct
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count
from weakref import WeakKeyDictionary

from semmap_log.live.planners.question_lines import MOST_LINE_BYTES, too_long, write_error

FEW = 64


class Deadlines:
    """One for each client at most; most are over before their time."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, Connection]] = []
        self._count = 0
        self._most = FEW
        """So many are kept, those that are over included, before these are sought out."""

    def __len__(self) -> int:
        return len(self._heap)

    def set(self, connection: Connection, seconds: float, at_deadline: Callable[[], None]) -> None:
        """Call something after a time, unless the client's deadline is another by then."""
        connection.deadline_s = time.monotonic() + seconds
        connection.at_deadline = at_deadline
        self._count += 1  # no two are alike, and connections cannot be compared
        heapq.heappush(self._heap, (connection.deadline_s, self._count, connection))
        if len(self._heap) > self._most:
            self._heap = [each for each in self._heap if each[2].deadline_s == each[0]]
            heapq.heapify(self._heap)
            self._most = max(FEW, 2 * len(self._heap))

    def next_s(self) -> float | None:
        """Return for how many seconds there is nothing to do; None: for ever."""
        return max(self._heap[0][0] - time.monotonic(), 0.0) if self._heap else None

    def meet(self) -> None:
        """Call what is due."""
        while self._heap and self._heap[0][0] <= time.monotonic():
            deadline_s, _, connection = heapq.heappop(self._heap)
            if connection.deadline_s == deadline_s:
                connection.deadline_s = None
                connection.at_deadline()


Work = Iterator[object]
"""Does one part at each `next`; at its end it is done."""


class Turns:
    """A thread that works for all, one part at a time.

    A client that comes, or comes back, counts as if it had had as much of the thread as who has had
    least: so one that asks now and then waits for one part of another's work, and no longer.
    """

    def __init__(self, name: str, *, rest: float = 0.0) -> None:
        """Begin.

        Args:
            name: Of the thread.
            rest: After each part it rests for so many times as long as the part took: of work that
                only who floods has much of, so that others have the interpreter meanwhile.
        """
        self._rest = rest
        self._waiting: list[tuple[float, int, Connection, Work]] = []
        self._used_s: WeakKeyDictionary[Connection, float] = WeakKeyDictionary()
        self._least_s = 0.0
        """What the client has used whose turn it was last."""
        self._numbers = count()
        self._changed = threading.Condition()
        self._is_closed = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def add(self, client: Connection, work: Work) -> None:
        """Have work done for a client; work that raises is over."""
        with self._changed:
            self._put(client, work, self._used_s.get(client, 0.0))

    def close(self) -> None:
        """Do what was begun, and end."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()
        self._thread.join()

    def _put(self, client: Connection, work: Work, used_s: float) -> None:
        place = max(used_s, self._least_s)
        heapq.heappush(self._waiting, (place, next(self._numbers), client, work))
        self._changed.notify()

    def _run(self) -> None:
        while (chosen := self._next()) is not None:
            used_s, _, client, work = chosen
            begun_s = time.monotonic()
            is_over = client.is_gone or _is_over(work)
            took_s = time.monotonic() - begun_s
            used_s += took_s
            with self._changed:
                self._used_s[client] = used_s
                if not is_over:
                    self._put(client, work, used_s)
            if self._rest:
                time.sleep(self._rest * took_s)

    def _next(self) -> tuple[float, int, Connection, Work] | None:
        """Return whose turn it is, once it is somebody's; None: there is no more to do."""
        with self._changed:
            while not self._waiting:
                if self._is_closed:
                    return None
                self._changed.wait()
            chosen = heapq.heappop(self._waiting)
            self._least_s = max(self._least_s, chosen[0])
            return chosen


def _is_over(work: Work) -> bool:
    """Do the next part of some work, and return whether it was the last, or has failed."""
    try:
        next(work)
    except Exception:  # noqa: BLE001  StopIteration, or what the work did not expect: others go on
        return True
    return False


AT_ONCE = 64
"""Before those that are there have their turn."""
OTHER_FILES = 200
"""Open files that are no clients: the log's, and what else the process has."""
KEPT_FILES = 64
"""No client gets these, however few the system allows: without files no question is answered."""

_NO_FILES = "the server cannot open more files; come later"


class Admission:
    """Lets clients in at a listening socket."""

    def __init__(self, listening: socket.socket, most_clients: int) -> None:
        """Allow so many files, as far as the system lets us."""
        listening.setblocking(False)
        self._listening = listening
        self._most_clients = most_clients
        self._most_files = _allow_files(most_clients + OTHER_FILES)
        self._spare: int | None = os.open(os.devnull, os.O_RDONLY)
        """Closed when no more files can be opened, so as to answer one who waits."""

    def admitted(self, present: int) -> Iterator[socket.socket]:
        """Yield who comes in now.

        Args:
            present: How many clients are there already.
        """
        for _ in range(AT_ONCE):
            try:
                connected, _ = self._listening.accept()
            except BlockingIOError:
                return
            except OSError as error:
                if error.errno in (errno.EMFILE, errno.ENFILE):
                    self._reject_by_spare()
                    return
                continue  # that one has gone again
            if connected.fileno() >= self._most_files:  # a new file has the lowest number there is
                _refuse(connected, _NO_FILES)
                continue
            if present >= self._most_clients:
                _refuse(connected, f"{self._most_clients:,} clients are here; come later")
                continue
            present += 1
            yield connected

    def close(self) -> None:
        """Let go of what was kept for telling."""
        if self._spare is not None:
            os.close(self._spare)
            self._spare = None

    def _reject_by_spare(self) -> None:
        """Send one client the answer that no more files can be open."""
        self.close()
        with contextlib.suppress(OSError):
            connected, _ = self._listening.accept()
            _refuse(connected, _NO_FILES)
        with contextlib.suppress(OSError):
            self._spare = os.open(os.devnull, os.O_RDONLY)


def _refuse(connected: socket.socket, problem: str) -> None:
    """Send a client the reason why it is not accepted."""
    with connected, contextlib.suppress(OSError):
        connected.setblocking(False)
        connected.send(write_error(problem))


def _allow_files(count: int) -> int:
    """Let the process have so many files open, as far as the system lets it.

    Returns:
        How many may be open while clients are let in.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY:
        return sys.maxsize
    wanted = count if hard == resource.RLIM_INFINITY else min(count, hard)
    if soft < wanted:
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
            soft = wanted
    return soft - min(KEPT_FILES, soft // 4)


CHUNK_BYTES = 2**14
MOST_ANSWERS_BYTES = 2**16
"""No more questions are read from a client while so many of its answers wait."""


@dataclass(frozen=True, slots=True)
class Broken:
    """What came in the place of a line."""

    problem: str
    is_json: bool
    """Whether it began as a question in JSON does."""

    @classmethod
    def of(cls, begun: bytes, problem: str) -> Broken:
        """Return what is wrong with a line that began like that."""
        return cls(problem, begun.startswith(b"{"))


class Connection:
    """A client; only the server's own thread touches it."""

    def __init__(self, connected: socket.socket, *, is_known: bool) -> None:
        """Take up a client.

        Args:
            connected: Its socket.
            is_known: Whether it may ask; else it gives a token first.
        """
        connected.setblocking(False)
        if connected.family != socket.AF_UNIX:
            _notice_silence(connected)
        self.socket = connected
        self.client = peer_of(connected)
        self.is_known = is_known
        self.lines: deque[bytes | Broken] = deque()
        """What came and was not looked at yet."""
        self.is_busy = False
        """Its last question is not answered yet."""
        self.has_ended = False
        """It asks nothing more."""
        self.is_leaving = False
        """It is let go of as soon as it has its answers."""
        self.is_gone = False
        self.deadline_s: float | None = None
        self.at_deadline: Callable[[], None] = _nothing
        self.end_wait: Callable[[], None] = _nothing
        self.watched = 0
        """Which of its events the server waits for."""
        self._rest = b""
        """The beginning of a line."""
        self._skips = False
        """The line that it is in the middle of is too long."""
        self._answers = bytearray()

    @property
    def wants_more(self) -> bool:
        """Whether it may send: not while there is enough to do for it."""
        return not (self.has_ended or self.is_leaving or self.lines or self.is_full)

    @property
    def is_full(self) -> bool:
        """Whether it does not take its answers."""
        return len(self._answers) >= MOST_ANSWERS_BYTES

    @property
    def is_done(self) -> bool:
        """Whether it wants nothing more, and has all its answers."""
        wants_nothing = self.is_leaving or (self.has_ended and not self.lines)
        return wants_nothing and not (self._answers or self.is_busy)

    @property
    def has_answers(self) -> bool:
        """Whether answers wait to be taken."""
        return bool(self._answers)

    def receive(self) -> None:
        """Take in what it has sent.

        Raises:
            OSError: It has gone.
        """
        try:
            data = self.socket.recv(CHUNK_BYTES)
        except (BlockingIOError, InterruptedError):
            return
        if not data:
            self._end()
            return
        if not self._rest and not self._skips and data.find(b"\n") == len(data) - 1:
            self.lines.append(data[:-1])  # one line, and all of it: as nearly always
            return
        first, *others = data.split(b"\n")
        if not others:
            self._continue(first)
            return
        if self._skips:
            self._skips = False
        else:
            self.lines.append(self._rest + first)
        self._rest = b""
        self.lines.extend(others[:-1])
        self._continue(others[-1])

    def _continue(self, part: bytes) -> None:
        """Keep what is no whole line yet; of one that is too long, nothing."""
        if self._skips:
            return
        self._rest += part
        if len(self._rest) >= MOST_LINE_BYTES:
            self.lines.append(Broken.of(self._rest, too_long()))
            self._rest, self._skips = b"", True

    def _end(self) -> None:
        self.has_ended = True
        if self._rest:
            self.lines.append(Broken.of(self._rest, "expected a line end, got none"))
            self._rest = b""

    def answer(self, line: bytes) -> None:
        """Let it have a line, by `send`."""
        self._answers += line

    def send(self) -> None:
        """Give it what it takes of its answers.

        Raises:
            OSError: It has gone.
        """
        if not self._answers:
            return
        try:
            sent = self.socket.send(self._answers)
        except (BlockingIOError, InterruptedError):
            return
        if sent == len(self._answers):
            self._answers = bytearray()
        else:
            del self._answers[:sent]

    def is_abandoned(self) -> bool:
        """Return whether nobody is left to receive an answer, as far as the system knows."""
        poll = select.poll()
        poll.register(self.socket, 0)
        return any(events & (select.POLLHUP | select.POLLERR) for _, events in poll.poll(0))


def peer_of(connected: socket.socket) -> str:
    """Return who is at the other end, as far as that is known: `pid 4711`, `127.0.0.1:40102`."""
    try:
        if connected.family != socket.AF_UNIX:
            host, port, *_ = connected.getpeername()
            return f"{host}:{port}"
        if sys.platform == "linux":
            said = connected.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12)
            return f"pid {struct.unpack('3i', said)[0]}"
    except OSError:  # it has gone already
        pass
    return ""


def _notice_silence(connected: socket.socket) -> None:
    """Have the system detect within minutes that a machine has gone without closing."""
    connected.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in {"TCP_KEEPIDLE": 60, "TCP_KEEPINTVL": 20, "TCP_KEEPCNT": 6}.items():
        if (option := getattr(socket, name, None)) is not None:  # macOS has others
            connected.setsockopt(socket.IPPROTO_TCP, option, value)


def _nothing() -> None:
    """Do nothing."""
