"""The module and the real `semmap-log serve LOG --ask`: the same words on both sides."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.live.planners import parsed_questions
from tests.live.oprs.conftest import StartServer, StartStub
from tests.live.oprs.line_server import Answer
from tests.live.oprs.workshop import run_in
from tests.live.ros.running import DEADLINE_S, Running

pytestmark = pytest.mark.slow

NOT_DECLARED = {"WAIT_UNTIL", "HELP"}
"""A kernel waits by its own (^ …), which holds up no other plan; HELP is for people."""


class RealServer:
    """`serve --ask` on a log with doors 1 (open) and 2 (closed); it may be killed and started."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.socket = folder / "real"
        self.log = folder / "log"
        with sl.create(self.log, tz="UTC") as log:
            for state in ("open", "closed"):
                log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, state=state)
        self.starts = 0
        self.running = self.start()

    def start(self) -> Running:
        """Start it, and wait until it takes questions."""
        self.starts += 1
        words = [sys.executable, "-m", "semmap_log", "serve", self.log]
        running = run_in(
            self.folder / f"serve{self.starts}", [*words, "--ask", f"unix:{self.socket}"]
        )
        running.wait_for("questions are taken")
        return running

    def ask(self, line: bytes) -> bytes:
        """Return its answer to a line, over a connection of its own."""
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(DEADLINE_S)
            connection.connect(str(self.socket))
            connection.sendall(line + b"\n")
            with connection.makefile("rb") as lines:
                return lines.readline()

    def updates(self) -> int:
        """Return how many changes of doors are stored."""
        with sl.read(self.log) as log:
            return sum(entry.kind == "DoorUpdated" for entry in log.history())


@pytest.fixture
def real_server(tmp_path: Path) -> RealServer:
    """It ends with the test."""
    server = RealServer(tmp_path)
    yield server
    server.running.process.kill()
    server.running.process.wait(DEADLINE_S)


def test_all_that_can_be_asked_is_declared(start_stub: StartStub) -> None:
    """Predicates, functions and actions as the server's table has them."""
    declared = {
        (name, kind)
        for kind, name, _arity in map(
            str.split, start_stub(None).call("NAMES").strip(";").split(";")
        )
    }

    for question in parsed_questions.QUESTIONS:
        if question.name not in NOT_DECLARED:
            assert (question.name, question.kind.value) in declared


def test_the_twelve(start_stub: StartStub, real_server: RealServer) -> None:
    """Each question answered by the log, each action stored."""
    stub = start_stub(f"unix:{real_server.socket}", timeout_ms=60_000)
    calls = [
        ("DOOR_STATE_KNOWN DOOR_1", "TRUE"),
        ("DOOR_OPEN DOOR_1", "TRUE"),
        ("DOOR_CLOSED DOOR_1", "FALSE"),
        ("DOOR_OPEN DOOR_9", "FALSE"),
        ("DOOR_STATE DOOR_1", "OPEN"),
        ("DOOR_STATE DOOR_9", "NIL"),
        ('BELIEVED DOOR_STATE DOOR_2 AT "event:1"', "CLOSED"),
        ("GET_OPEN_DOOR $X", "T <- DOOR_1"),
        ("GET_CLOSED_DOOR $X", "T <- DOOR_2"),
        ("ANY_CLOSED_DOOR $X", "TRUE <- DOOR_2"),
        ("PROBABILITY_DOOR_OPEN DOOR_1", "NIL"),
        ("SET_OPEN_PROBABILITY DOOR_1 0.1", "T"),
        ("SET_CLOSED_PROBABILITY DOOR_1 0.30000000000000004", "T"),
        ("PROBABILITY_DOOR_OPEN DOOR_1", "0.10000000000000001"),
        ("PROBABILITY_DOOR_CLOSED DOOR_1", "0.30000000000000004"),
        ("SET_DOOR_CLOSED DOOR_1", "T"),
        ("GET_OPEN_DOOR", "NIL"),
        ("SET_DOOR_OPEN DOOR_2", "T"),
        ("DOORS", "(. DOOR_1 DOOR_2 .)"),
        ("REMOVE_DOOR DOOR_2", "T"),
        ("REMOVE_DOOR DOOR_9", "NIL"),
        ("DOOR_STATE_KNOWN DOOR_2", "FALSE"),
    ]

    assert calls == [(call, stub.call(call)) for call, _ in calls]
    assert stub.call("WHY DOOR_1").startswith('(. integer 4 "DoorUpdated" CLOSED ')
    assert 4 == real_server.updates()


def _killed_after_storing(server: RealServer, line: bytes) -> Answer:
    """Hand a line on; kill the server when it has answered, and let nobody hear the answer."""
    try:
        answer = server.ask(line)
    except OSError:
        return (b"",)
    if b"SET_" in line and server.starts == 1:
        assert b"T\n" == answer
        server.running.process.kill()
        server.running.process.wait(DEADLINE_S)
        return (b"",)
    return answer


def test_a_server_killed_between_commit_and_answer(
    start_stub: StartStub, start_server: StartServer, real_server: RealServer
) -> None:
    """NIL; the same action once more, when it is back, is answered T and stored once."""
    between = start_server(lambda line: _killed_after_storing(real_server, line))
    stub = start_stub(between.address, timeout_ms=60_000)

    assert "NIL" == stub.call("SET_DOOR_OPEN DOOR_2")
    real_server.running = real_server.start()
    assert "T" == stub.call("SET_DOOR_OPEN DOOR_2")

    assert "TRUE" == stub.call("DOOR_OPEN DOOR_2")
    assert 1 == real_server.updates()
