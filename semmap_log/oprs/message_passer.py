"""A client of OpenPRS's message passer, `mp-oprs`.

Integers are four bytes, the greatest first; a text is its length and its bytes. A client sends the
protocol it wants (1: texts) and its name, and gets 0 where it was taken in. Then it sends 1, a
recipient and a text, and gets a sender and a text. A passer knows no password and may listen on all
interfaces: whoever reaches it can send anything to any kernel.
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass

from semmap_log.errors import SemmapError
from semmap_log.oprs.expressions import Expression, write

PORT = 3300
"""As `mp-oprs` chooses it."""
PASSER = "mp-oprs"
"""Whom a message comes from that says `(unknown NAME)`: the recipient of another is not there."""
MOST_BYTES = 2**20
"""Of a name or a text that comes."""

_TEXTS = 1
_TO_ONE, _TO_ALL = 1, 2
_TAKEN_IN, _NAME_IS_TAKEN = 0, 1
_READ_BYTES = 2**16


class PasserError(SemmapError):
    """The message passer is not there, refused us, went away, or sent what is no message."""


@dataclass(frozen=True, slots=True)
class Message:
    """What came."""

    sender: str
    text: str


def registration(name: str) -> bytes:
    """Return what a client says first."""
    return struct.pack(">I", _TEXTS) + _text(name)


def message_to(recipient: str, said: Expression) -> bytes:
    """Return what sends an expression to one client."""
    return struct.pack(">I", _TO_ONE) + _text(recipient) + _text(write(said))


def message_to_all(said: Expression) -> bytes:
    """Return what sends an expression to all other clients."""
    return struct.pack(">I", _TO_ALL) + _text(write(said))


def _text(text: str) -> bytes:
    data = text.encode()
    return struct.pack(">I", len(data)) + data


class MessageBuffer:
    """Messages out of bytes, however they are cut into pieces."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def feed(self, data: bytes) -> None:
        """Take in what came."""
        self._bytes += data

    def __iter__(self) -> Iterator[Message]:
        """Yield the messages that are whole.

        Raises:
            PasserError: One of them would be longer than 1 MiB.
        """
        while (end := self._end_of_text(0)) and (whole := self._end_of_text(end)):
            sender, text = self._bytes[4:end], self._bytes[end + 4 : whole]
            message = Message(sender.decode(errors="replace"), text.decode(errors="replace"))
            del self._bytes[:whole]
            yield message

    def _end_of_text(self, start: int) -> int:
        """Return where a text ends; 0: it is not whole."""
        if len(self._bytes) < start + 4:
            return 0
        (length,) = struct.unpack_from(">I", self._bytes, start)
        if length > MOST_BYTES:
            raise PasserError(
                f"expected a message of at most {MOST_BYTES:,} bytes, one of {length:,} comes."
            )
        end: int = start + 4 + length
        return end if end <= len(self._bytes) else 0


class PasserClient:
    """A client that is registered; `with` says good-bye."""

    def __init__(self, connection: socket.socket, where: str) -> None:
        self._socket = connection
        self._where = where
        self._messages = MessageBuffer()

    @classmethod
    def connect(cls, host: str, port: int, name: str, *, timeout_s: float = 10.0) -> PasserClient:
        """Register with a message passer.

        Args:
            host: Where it is.
            port: Its port.
            name: By which others send to us; its case counts.
            timeout_s: Of connecting, and of each sending.

        Raises:
            PasserError: It is not there, does not answer, or refuses; a name is to be had once.
        """
        where = f"message passer {host}:{port}"
        try:
            connection = socket.create_connection((host, port), timeout_s)
        except OSError as error:
            raise PasserError(f"{where}: {error}.") from error
        try:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection.sendall(registration(name))  # at once: half of it would stop the passer
            answer = _receive_int(connection)
        except OSError as error:
            connection.close()
            raise PasserError(f"{where}: {error}.") from error
        if answer != _TAKEN_IN:
            connection.close()
            why = f"the name {name} is taken" if answer == _NAME_IS_TAKEN else "it refused us"
            raise PasserError(f"{where}: {why} (answer {answer}).")
        return cls(connection, where)

    def fileno(self) -> int:
        """Return the socket's descriptor, to wait for."""
        return self._socket.fileno()

    def send(self, recipient: str, said: Expression) -> None:
        """Send an expression to one client.

        Raises:
            ExpressionError: It cannot be written.
            PasserError: The passer is gone, or takes nothing.
        """
        self._send(message_to(recipient, said))

    def send_to_all(self, said: Expression) -> None:
        """Send an expression to all other clients.

        Raises:
            ExpressionError: It cannot be written.
            PasserError: The passer is gone, or takes nothing.
        """
        self._send(message_to_all(said))

    def receive(self, timeout_s: float) -> Message | None:
        """Return the next message; None: none came in time.

        Raises:
            PasserError: The passer is gone, or what comes is no message.
        """
        end = time.monotonic() + timeout_s
        while (message := next(iter(self._messages), None)) is None:
            before = self._socket.gettimeout()
            self._socket.settimeout(max(0.0, end - time.monotonic()))
            try:
                data = self._socket.recv(_READ_BYTES)
            except (TimeoutError, BlockingIOError):
                return None
            except OSError as error:
                raise PasserError(f"{self._where}: {error}.") from error
            finally:
                self._socket.settimeout(before)
            if not data:
                raise PasserError(f"{self._where}: has gone.")
            self._messages.feed(data)
        return message

    def close(self) -> None:
        """Hang up; the name is free again."""
        self._socket.close()

    def __enter__(self) -> PasserClient:  # noqa: PYI034 - Self came with Python 3.11
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _send(self, data: bytes) -> None:
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise PasserError(f"{self._where}: {error}.") from error


def _receive_int(connection: socket.socket) -> int:
    data = b""
    while len(data) < 4:
        more = connection.recv(4 - len(data))
        if not more:
            raise ConnectionResetError("it hung up")
        data += more
    (number,) = struct.unpack(">I", data)
    return int(number)
