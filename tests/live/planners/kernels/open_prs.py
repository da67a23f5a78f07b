"""A real message passer and real kernels of OpenPRS; skipped where SEMMAP_OPRS names none."""

from __future__ import annotations

import contextlib
import itertools
import os
import socket
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.live.planners.kernels.stub_passer import Client
from tests.live.ros.running import DEADLINE_S, Running, wait_until

VARIABLE = "SEMMAP_OPRS"

PLANS = """(
(defop SEND-MESSAGE :invocation (! (SEND-MESSAGE $T $M)) :action (SEND-MESSAGE $T $M))
(defop SHOW :invocation (SHOW $P $D) :body (
  (IF (? ($P $D $V)) (! (SEND-MESSAGE PY (HAS $D $V))) ELSE (! (SEND-MESSAGE PY (HAS_NOT $D))))))
(defop ASK :invocation (LET_ASK $I $Q) :body (
  (! (SEND-MESSAGE SEMMAP (ASK $I $Q)))
  (^ (ANSWER $I $V))
  (! (SEND-MESSAGE PY (GOT $I $V)))
  (~> (ANSWER $I $V))))
(defop STATE :invocation (DOOR_STATE $D $S) :body ((! (SEND-MESSAGE PY (SAW $D $S)))))
)
"""
INCLUDE = """load opf "{}"
declare ff DOOR_STATE 1
declare ff DOOR_PROBABILITY 1
declare ff DOOR_NAME 1
declare ff DOOR_FACTS 1
declare ff ANSWER 1
"""


def programs() -> Path:
    """Return the folder of the programs; skip where there is none."""
    folder = os.environ.get(VARIABLE)
    if not folder:
        pytest.skip(f"{VARIABLE} is not set: it names the folder in which OpenPRS was built")
    found = Path(folder) / "src"
    if not (found / "mp-oprs").exists():
        pytest.skip(f"{VARIABLE}={folder}: has no src/mp-oprs")
    return found


class OpenPrs:
    """A passer's port, and what runs at it; all is ended with it."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self._programs = programs()
        self._stack = stack
        self._count = itertools.count()
        self.folder = folder
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port: int = free.getsockname()[1]

    def passer(self) -> Running:
        """Start a message passer."""
        passer = self.run("mp-oprs", "-j", str(self.port))
        passer.wait_for("Message passer running")
        wait_until(lambda: _is_listened_at(self.port), "the passer, which says so before it is so")
        return passer

    def kernel(self, name: str, include: str | None = None, folder: Path | None = None) -> Running:
        """Start a kernel with plans of ours, or with an include file."""
        if include is None:
            (self.folder / "plans.opf").write_text(PLANS)
            path = self.folder / "plans.inc"
            path.write_text(INCLUDE.format(self.folder / "plans.opf"))
            include = str(path)
        kernel = self.run("oprs", "-a", "-q", "-l", "none", "-m", "127.0.0.1", "-j", str(self.port),
                          "-n", name, "-x", include, folder=folder)  # fmt: skip
        kernel.wait_for("Closing file .*inc")
        return kernel

    def run(self, program: str, *options: str, folder: Path | None = None) -> Running:
        out = self.folder / f"{next(self._count)}"
        out.mkdir()
        with (out / "stdout").open("wb") as stdout, (out / "stderr").open("wb") as stderr:
            process = subprocess.Popen(
                [self._programs / program, *options], stdin=subprocess.DEVNULL, stdout=stdout,
                stderr=stderr, cwd=folder or self.folder,
            )  # fmt: skip
        return self._stack.enter_context(Running(process, program, out))

    def client(self, name: str = "PY") -> PasserClient:
        """Let a client of the test come."""
        return self._stack.enter_context(contextlib.closing(PasserClient(self.port, name)))


def _is_listened_at(port: int) -> bool:
    """Tell whether connections are taken; none is made, which the passer would wait for."""
    rows = Path("/proc/net/tcp").read_text(encoding="ascii").splitlines()[1:]
    return any(row.split()[1:4:2] == [f"00000000:{port:04X}", _TCP_LISTEN] for row in rows)


_TCP_LISTEN = "0A"


class PasserClient:
    """A client of the test, of which nothing is code of ours."""

    def __init__(self, port: int, name: str) -> None:
        self._client = Client(socket.create_connection(("127.0.0.1", port)), name)
        self._client.connection.settimeout(DEADLINE_S)
        self._client.write(1, name.encode())
        assert self._client.read_int() == 0

    def send(self, kernel: str, text: str) -> None:
        self._client.write(1, kernel.encode(), text.encode())

    def receive(self) -> tuple[str, str]:
        """Return the next message and its sender."""
        return self._client.read_text(), self._client.read_text()

    def receive_until(self, text: str) -> None:
        """Take messages until one comes."""
        got = []
        while text not in got[-1:]:
            got.append(self.receive()[1])

    def ask(self, kernel: str, text: str) -> str:
        """Return what a kernel answers; what it says of doors that it saw comes between."""
        self.send(kernel, text)
        while (said := self.receive())[1].startswith("(SAW") or said[0] != kernel:
            assert "unknown" not in said[1], said
        return said[1]

    def wait_for(self, kernel: str, question: str, answer: str) -> None:
        """Ask until that is the answer."""
        got: list[str] = []

        def is_so() -> bool:
            got.append(self.ask(kernel, question))
            return got[-1] == answer

        wait_until(is_so, lambda: f"{answer} to {question} of {kernel}: {got[-5:]}")

    def close(self) -> None:
        self._client.connection.close()


@contextlib.contextmanager
def open_prs(folder: Path) -> Iterator[OpenPrs]:
    """Let passers and kernels run within."""
    with ExitStack() as stack:
        yield OpenPrs(folder, stack)
