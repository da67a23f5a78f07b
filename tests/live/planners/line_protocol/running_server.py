"""A server of questions in this process, and raw clients of it."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from semmap_log.live.planners.addresses import listen, read_address
from semmap_log.live.planners.line_protocol.ask_server import AskServer
from tests.live.planners.asker import Asker
from tests.live.ros.running import DEADLINE_S


@contextmanager
def serving(
    ask: Asker, address: str, *, any_host: bool = False, **more: object
) -> Iterator[AskServer]:
    """Run a server of an oracle."""
    listener = listen(read_address(address), any_host=any_host)
    server = AskServer(ask.oracle, listener, say=ask.said.append, **more)
    try:
        yield server
    finally:
        server.close()


class Raw:
    """A client that sends and gets bytes."""

    def __init__(self, address: str) -> None:
        self.socket = read_address(address).connect()
        self.socket.settimeout(DEADLINE_S)
        self._lines = self.socket.makefile("rb")

    def send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def line(self) -> str:
        """Return the next line; "" at the end."""
        return self._lines.readline().decode().removesuffix("\n")

    def ask(self, text: str) -> str:
        self.send(text.encode() + b"\n")
        return self.line()

    def half_close(self) -> None:
        self.socket.shutdown(socket.SHUT_WR)

    def close(self) -> None:
        self._lines.close()
        self.socket.close()

    def __enter__(self) -> Raw:  # noqa: PYI034 - Self came with Python 3.11
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def unix_in(folder: Path) -> str:
    return f"unix:{folder / 's'}"
