"""A message passer in this process, as the real one behaves."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading


class Passer:
    """Listens at `port`; `with` ends it, and all connections with it."""

    def __init__(self, port: int = 0) -> None:
        self.clients: dict[str, socket.socket] = {}
        self.heard: list[tuple[str, str, str]] = []
        """Sender, recipient ("": all) and text of what came."""
        self._mutex = threading.Lock()
        self._listener = socket.create_server(("127.0.0.1", port))
        self.port: int = self._listener.getsockname()[1]
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def __enter__(self) -> Passer:  # noqa: PYI034 - Self came with Python 3.11
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        with self._mutex:
            clients = list(self.clients.values())
        for client in clients:
            with contextlib.suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join(10)

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                self._threads.append(threading.Thread(target=self._serve, args=(client,)))
                self._threads[-1].start()

    def _serve(self, client: socket.socket) -> None:
        with client, contextlib.suppress(OSError, struct.error):
            stream = client.makefile("rb")
            (protocol,) = struct.unpack(">I", stream.read(4))
            assert 1 == protocol
            name = _read_text(stream)
            with self._mutex:
                is_taken = name in self.clients
                client.sendall(struct.pack(">I", int(is_taken)))  # before anybody can send to it
                if is_taken:
                    return
                self.clients[name] = client
            try:
                self._pass_on(name, stream)
            finally:
                del self.clients[name]

    def _pass_on(self, name: str, stream: object) -> None:
        while True:
            (kind,) = struct.unpack(">I", stream.read(4))  # type: ignore[attr-defined]
            recipient = _read_text(stream) if kind == 1 else ""
            text = _read_text(stream)
            self.heard.append((name, recipient, text))
            with self._mutex:  # who has its answer is among the clients
                if kind == 1 and recipient not in self.clients:
                    _send(self.clients[name], "mp-oprs", f"(unknown {recipient})")
                    continue
                everybody = [each for each in self.clients if each != name]
                for each in [recipient] if kind == 1 else everybody:
                    with contextlib.suppress(OSError):  # it has just hung up
                        _send(self.clients[each], name, text)


def _read_text(stream: object) -> str:
    (length,) = struct.unpack(">I", stream.read(4))  # type: ignore[attr-defined]
    return stream.read(length).decode()  # type: ignore[attr-defined,no-any-return]


def _send(client: socket.socket, sender: str, text: str) -> None:
    parts = [each.encode() for each in (sender, text)]
    client.sendall(b"".join(struct.pack(">I", len(part)) + part for part in parts))
