"""A server in this process that answers lines as a test tells it to, well or badly."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable
from pathlib import Path

HANG = b""
"""Instead of an answer: none, ever."""

Answer = bytes | tuple[bytes, ...]
"""What is sent for a line, and then, in a tuple: None more, the connection is closed."""


class LineServer:
    """Listens at `address`; `with` ends it.

    Args:
        answer: From a line to what is sent back: bytes as they are (`HANG`: nothing); in a tuple,
            the connection is closed behind them.
        place: Path of a Unix socket; None: a TCP port of the loopback device.
    """

    def __init__(self, answer: Callable[[bytes], Answer], place: Path | None = None) -> None:
        self.answer = answer
        self.lines: list[bytes] = []
        """All that came, of all connections."""
        self.connections: list[socket.socket] = []
        self._listener = socket.socket(socket.AF_UNIX if place else socket.AF_INET)
        self._listener.bind(str(place) if place else ("127.0.0.1", 0))
        self._listener.listen(16)
        where = self._listener.getsockname()
        self.address = f"unix:{place}" if place else f"tcp:127.0.0.1:{where[1]}"
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def __enter__(self) -> LineServer:  # noqa: PYI034 - Self came with Python 3.11
        return self

    def __exit__(self, *_: object) -> None:
        self.hang_up()
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for thread in self._threads:
            thread.join(10)

    def hang_up(self) -> None:
        """Close all connections."""
        for connection in self.connections:
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._listener.accept()
                self.connections.append(connection)
                thread = threading.Thread(target=self._serve, args=(connection,), daemon=True)
                self._threads.append(thread)
                thread.start()

    def _serve(self, connection: socket.socket) -> None:
        with connection, contextlib.suppress(OSError), connection.makefile("rb") as lines:
            for line in lines:
                self.lines.append(line.removesuffix(b"\n"))
                answer = self.answer(self.lines[-1])
                connection.sendall(b"".join(answer) if isinstance(answer, tuple) else answer)
                if isinstance(answer, tuple):
                    connection.shutdown(socket.SHUT_RDWR)
                    return
