"""A message passer of our own, written from the protocol as it is published: no code of the client.

It is strict: whatever is not in the table is a fault, kept in `faults`. It keeps each message that
was sent, and by whom to whom.
"""

from __future__ import annotations

import contextlib
import socket
import threading
from dataclasses import dataclass, field

from tests.live.ros.running import wait_until


@dataclass(eq=False)
class Client:
    """One that has registered, or wants to."""

    connection: socket.socket
    name: str = ""
    said_goodbye: bool = False
    mutex: threading.Lock = field(default_factory=threading.Lock)

    def read(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            piece = self.connection.recv(count - len(data))
            if not piece:
                raise EOFError(f"{len(data)} of {count} bytes")
            data += piece
        return data

    def read_int(self) -> int:
        return int.from_bytes(self.read(4), "big", signed=True)

    def read_text(self) -> str:
        length = self.read_int()
        assert 0 < length < 2**21, f"a string of {length} bytes"
        return self.read(length).decode(errors="surrogateescape")

    def write(self, *parts: bytes | int) -> None:
        data = b"".join(
            part.to_bytes(4, "big") if isinstance(part, int)
            else len(part).to_bytes(4, "big") + part
            for part in parts
        )  # fmt: skip
        with self.mutex, contextlib.suppress(OSError):
            self.connection.sendall(data)


class StubPasser:
    """Runs until it is closed."""

    def __init__(self, port: int = 0, *, answer: int = 0) -> None:
        self.faults: list[str] = []
        self.messages: list[tuple[str, str, str]] = []
        """Sender, recipient, text; those of kernels of a test are not here."""
        self.clients: dict[str, Client] = {}
        self.registrations = 0
        self.answer = answer
        self.reads = threading.Event()
        self.reads.set()
        self._all: list[Client] = []
        self._listener = socket.create_server(("127.0.0.1", port))
        self.port: int = self._listener.getsockname()[1]
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def kernel(self, name: str) -> StubKernel:
        """Let a kernel come."""
        return StubKernel(self, name)

    def texts(self, recipient: str, sender: str = "SEMMAP") -> list[str]:
        """What one was sent, or would have been."""
        return [text for who, to, text in list(self.messages) if (who, to) == (sender, recipient)]

    def wait_for(self, recipient: str, text: str, sender: str = "SEMMAP") -> None:
        wait_until(
            lambda: text in self.texts(recipient, sender),
            lambda: f"{text} to {recipient}, got {self.texts(recipient, sender)[-20:]}",
        )

    def wait_until_there(self, name: str) -> None:
        wait_until(lambda: name in self.clients, f"{name} to register")

    def close(self) -> None:
        """Go, as when it is killed."""
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self.reads.set()
        for client in self._all:
            with contextlib.suppress(OSError):
                client.connection.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        for client in self._all:
            client.connection.close()

    def __enter__(self) -> StubPasser:  # noqa: PYI034 - Self came with Python 3.11
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
        assert [] == self.faults

    def send(self, client: Client, sender: str, text: str) -> None:
        client.write(sender.encode(), text.encode(errors="surrogateescape"))

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            client = Client(connection)
            self._all.append(client)
            thread = threading.Thread(target=self._serve, args=(client,), daemon=True)
            self._threads.append(thread)
            thread.start()

    def _serve(self, client: Client) -> None:
        try:
            if not self._register(client):
                return
            while self._take(client):
                self.reads.wait()
        except EOFError as error:
            if not str(error).startswith("0 of 4"):
                self.faults.append(f"{client.name} left in the middle: {error}")
        except OSError:
            pass
        except (AssertionError, UnicodeDecodeError) as error:
            self.faults.append(f"{client.name}: {error}")
        finally:
            if self.clients.get(client.name) is client:
                del self.clients[client.name]
            with contextlib.suppress(OSError):
                client.connection.shutdown(socket.SHUT_RDWR)

    def _register(self, client: Client) -> bool:
        self.reads.wait()
        assert client.read_int() == 1, "messages are wanted as strings"
        client.name = client.read_text()
        assert client.name not in ("kill-mp", "mp-oprs", "oprs-server", "ope")
        self.registrations += 1
        if self.answer or client.name in self.clients:
            client.write(self.answer or 1)
            return False
        self.clients[client.name] = client
        client.write(0)
        return True

    def _take(self, client: Client) -> bool:
        kind = client.read_int()
        if kind == 4:
            client.said_goodbye = True
            return False
        assert kind in (1, 3), f"a message of type {kind}"
        if kind == 1:
            recipients = [client.read_text()]
            text = client.read_text()
        else:
            count = client.read_int()
            assert 1 < count < 1000, f"{count} recipients"
            text = client.read_text()
            recipients = [client.read_text() for _ in range(count)]
        self._check(client, text, recipients)
        for recipient in recipients:
            self.messages.append((client.name, recipient, text))
            to = self.clients.get(recipient)
            if to is None:
                client.write(b"mp-oprs", f"(unknown {recipient})\n".encode())
            else:
                self.send(to, client.name, text)
        return True

    @staticmethod
    def _check(client: Client, text: str, recipients: list[str]) -> None:
        """What a kernel or a passer has died of, or has run as its commands."""
        if client.name != "SEMMAP":
            return
        assert text.startswith("("), text
        assert text.endswith(")"), text
        assert text.isprintable(), text
        assert all(len(name.encode()) <= 80 for name in recipients), recipients


class StubKernel:
    """A client of a test, as a kernel is one; what it is sent is in the passer's `messages`."""

    def __init__(self, passer: StubPasser, name: str) -> None:
        self._passer = passer
        self._name = name
        self._connection = socket.create_connection(("127.0.0.1", passer.port))
        self._client = Client(self._connection)
        self._client.write(1, name.encode())
        assert self._client.read_int() == 0
        self._reader = threading.Thread(target=self._drain, daemon=True)
        self._reader.start()

    def send(self, text: str, to: str = "SEMMAP") -> None:
        data = text.encode(errors="surrogateescape")
        self._client.write(1, to.encode(), data)

    def answer(self, text: str, ask_id: str) -> str:
        """Ask, and return the answer."""
        before = len(self.answers(ask_id))
        self.send(text)
        wait_until(
            lambda: len(self.answers(ask_id)) > before,
            lambda: f"an answer to {text}: {self._passer.texts(self._name)[-5:]}",
        )
        return self.answers(ask_id)[-1]

    def answers(self, ask_id: str) -> list[str]:
        start = f"(ANSWER {ask_id} "
        texts = self._passer.texts(self._name)
        return [text[len(start) : -1] for text in texts if text.startswith(start)]

    def close(self) -> None:
        with contextlib.suppress(OSError):
            self._connection.shutdown(socket.SHUT_RDWR)
        self._reader.join()
        self._connection.close()
        wait_until(lambda: self._name not in self._passer.clients, "the passer to see it")

    def __enter__(self) -> StubKernel:  # noqa: PYI034 - Self came with Python 3.11
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _drain(self) -> None:
        with contextlib.suppress(OSError):
            while self._connection.recv(65536):
                pass
