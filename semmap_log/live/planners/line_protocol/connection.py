"""One client of a server of questions: bytes in, lines out of them, and answers that wait."""

from __future__ import annotations

import select
import socket
import struct
import sys
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from semmap_log.live.planners.question_lines import MOST_LINE_BYTES, too_long

CHUNK_BYTES = 2**14
MOST_ANSWERS_BYTES = 2**16
"""A client that does not take its answers is asked nothing more while so many wait."""


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
            self._go_on(first)
            return
        if self._skips:
            self._skips = False
        else:
            self.lines.append(self._rest + first)
        self._rest = b""
        self.lines.extend(others[:-1])
        self._go_on(others[-1])

    def _go_on(self, part: bytes) -> None:
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
        """Tell whether nobody is there any more to take an answer, as far as the system knows."""
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
    """Have the system find out when a machine is gone that said no good-bye: in some minutes."""
    connected.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in {"TCP_KEEPIDLE": 60, "TCP_KEEPINTVL": 20, "TCP_KEEPCNT": 6}.items():
        if (option := getattr(socket, name, None)) is not None:  # macOS has others
            connected.setsockopt(socket.IPPROTO_TCP, option, value)


def _nothing() -> None:
    """Do nothing."""
