"""A connection to OPRS's message passer, as one of its clients.

It never keeps the passer waiting: the passer has one thread, and stands still for all its kernels
while a client does not take what it is given, or sends half of something. So what comes is always
taken, and what goes out is whole messages, of which the system gets as much as it takes.
"""

from __future__ import annotations

import contextlib
import select
import socket
import time

from semmap_log.errors import PasserError
from semmap_log.live.planners.addresses import TcpAddress, reason_of
from semmap_log.live.planners.kernels.passer_frames import (
    NAME_TAKEN,
    REGISTERED,
    MessageReader,
    goodbye,
    registration,
)

CONNECT_S = 5.0
CLOSE_S = 1.0
_AT_ONCE = 2**18


class PasserConnection:
    """Sends and receives messages under a name."""

    def __init__(self, address: TcpAddress, name: str, *, timeout_s: float = CONNECT_S) -> None:
        """Register.

        Args:
            address: Where the passer listens.
            name: Ours.
            timeout_s: How long to wait for it.

        Raises:
            PasserError: It is not there, does not answer, or has another client of that name.
        """
        first = registration(name)
        try:
            self.socket = socket.create_connection((address.host, address.port), timeout_s)
        except (OSError, UnicodeError) as error:
            reason = reason_of(error)
            raise PasserError(f"no message passer at {_said(address)}: {reason}.") from error
        self._received = MessageReader()
        self._out = bytearray()
        try:
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.socket.sendall(first)
            self._check(self._answer(time.monotonic() + timeout_s), address, name)
            self.socket.setblocking(False)
        except OSError as error:
            self.socket.close()
            if isinstance(error, PasserError):
                raise
            raise PasserError(f"the message passer at {_said(address)} left: {error}.") from error

    @property
    def waiting_bytes(self) -> int:
        """How much was put and not yet taken by the passer."""
        return len(self._out)

    def put(self, frame: bytes) -> None:
        """Have a message sent by the next calls of `send`."""
        self._out += frame

    def send(self) -> None:
        """Send what the passer takes now.

        Raises:
            PasserError: It has gone.
        """
        try:
            while self._out:
                with memoryview(self._out)[:_AT_ONCE] as piece:
                    sent = self.socket.send(piece)
                del self._out[:sent]
        except BlockingIOError:
            pass
        except OSError as error:
            raise PasserError(f"the message passer has gone: {error}.") from error

    def receive(self) -> list[tuple[bytes, bytes]]:
        """Return the sender and the text of each message that has come as a whole.

        Raises:
            PasserError: It has gone, or is no message passer.
        """
        try:
            data = self.socket.recv(_AT_ONCE)
        except BlockingIOError:
            return []
        except OSError as error:
            raise PasserError(f"the message passer has gone: {error}.") from error
        if not data:
            raise PasserError("the message passer has gone.")
        self._received.take(data)
        return self._received.messages()

    def close(self) -> None:
        """Leave: the passer is told, and what it still sends is taken until it lets go."""
        end_s = time.monotonic() + CLOSE_S
        with contextlib.suppress(OSError):
            self.put(goodbye())
            while (left_s := end_s - time.monotonic()) > 0:
                writes = [self.socket] if self._out else []
                can_read, can_write, _ = select.select([self.socket], writes, [], left_s)
                if can_write:
                    self.send()
                if can_read and not self.socket.recv(_AT_ONCE):
                    break
        self.socket.close()

    def _answer(self, end_s: float) -> int:
        while (answer := self._received.registered()) is None:
            self.socket.settimeout(max(end_s - time.monotonic(), 0.001))
            data = self.socket.recv(_AT_ONCE)
            if not data:
                raise PasserError("the message passer left without an answer.")
            self._received.take(data)
        return answer

    def _check(self, answer: int, address: TcpAddress, name: str) -> None:
        if answer == NAME_TAKEN:
            raise PasserError(
                f"the message passer at {_said(address)} has another client called {name}: it must "
                "leave, or --oprs-name give another name."
            )
        if answer != REGISTERED:
            raise PasserError(
                f"the message passer at {_said(address)} does not let {name} in: it answered "
                f"{answer}, expected {REGISTERED}."
            )


def _said(address: TcpAddress) -> str:
    return str(address).removeprefix("tcp:")
