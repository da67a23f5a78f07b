"""The module and a server that is slow, gone, broken or hostile: never a hang, never a death."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from tests.live.oprs.conftest import StartServer, StartStub
from tests.live.oprs.line_server import HANG, Answer, LineServer
from tests.live.ros.running import DEADLINE_S, wait_until

LONG_MS = 60_000
"""A time-out that no test reaches."""


def test_a_slow_server_costs_the_time_out_and_its_late_answer_nothing(
    start_stub: StartStub, start_server: StartServer
) -> None:
    """The connection goes with the question, so no answer meets another question."""
    late = threading.Event()

    def answer(line: bytes) -> bytes:
        if b"DOOR_1" in line:
            late.wait(60)
            return b"T\n"
        return b"NIL\n"

    server = start_server(answer)
    stub = start_stub(server.address, timeout_ms=2000)

    assert "FALSE" == stub.call("DOOR_OPEN DOOR_1")
    assert "no answer within 2000 ms" in stub.call("DOOR_MAP_PROBLEM")
    stub.send("DOOR_OPEN DOOR_2")
    time.sleep(0.2)
    late.set()
    assert "FALSE" == stub.result()
    assert ["FALSE"] * 20 == [stub.call("DOOR_OPEN DOOR_2") for _ in range(20)]
    assert 2 == len(server.connections)


def test_signals_do_not_prolong_the_time_out(
    start_stub: StartStub, start_server: StartServer
) -> None:
    """A timer that interrupts the wait twenty times: started anew each time, it never ended."""
    server = start_server(lambda _line: HANG)
    stub = start_stub(server.address, {"STUB_TICK_MS": "10"}, timeout_ms=200)

    assert "FALSE" == stub.call("DOOR_OPEN DOOR_1")


def test_signals_do_not_shorten_it(start_stub: StartStub, start_server: StartServer) -> None:
    """An interrupted wait, read or write is gone on with."""

    def answer(line: bytes) -> bytes:
        time.sleep(0.05)
        return line.partition(b" ")[2] + b"\n"

    server = start_server(answer)
    stub = start_stub(server.address, {"STUB_TICK_MS": "5"}, timeout_ms=LONG_MS)
    text = "61" * 30_000

    assert bytes.fromhex(text).decode() == stub.call(f"ASK_DOOR_MAP ECHO x{text}")[1:-1]


@pytest.mark.parametrize(
    "broken",
    [b"T\nT\n", b"T\0\n", b"\0" * 70_000 + b"\n", b"a" * (1 << 20) + b"\n", b"a" * 65_536],
    ids=["two lines", "NUL", "NULs", "1 MB", "64 KiB"],
)
def test_what_is_no_line_is_nil(
    start_stub: StartStub, start_server: StartServer, broken: bytes
) -> None:
    """And the next question, over a new connection, has its own answer."""
    server = start_server(lambda line: broken if b"DOOR_1" in line else b"T\n")
    stub = start_stub(server.address, timeout_ms=LONG_MS)

    assert ["FALSE", "TRUE"] == [stub.call("DOOR_OPEN DOOR_1"), stub.call("DOOR_OPEN DOOR_2")]


def test_half_a_line_and_then_silence(start_stub: StartStub, start_server: StartServer) -> None:
    """It is no answer, also if what is there looks like one."""
    server = start_server(lambda _line: b"T")
    stub = start_stub(server.address, timeout_ms=100)

    assert "FALSE" == stub.call("DOOR_OPEN DOOR_1")


def test_the_longest_line_is_taken(start_stub: StartStub, start_server: StartServer) -> None:
    """64 KiB with its newline, to and fro."""
    text = "a" * (65_536 - len('WHY ""\n'))
    server = start_server(lambda line: line.partition(b" ")[2].ljust(65_535) + b"\n")
    stub = start_stub(server.address, timeout_ms=LONG_MS)

    assert f'"{text}"' == stub.call(f"WHY x{text.encode().hex()}")
    assert 65_535 == len(server.lines[0])


@pytest.mark.parametrize("half", [(b"",), (b"T",)], ids=["at once", "in the middle of the line"])
def test_a_connection_that_is_lost_is_made_once_more(
    start_stub: StartStub, start_server: StartServer, half: tuple[bytes, ...]
) -> None:
    """With the same question, and for an action with the same id: it may have been stored."""
    answers: list[Answer] = [half, b"T\n", half, b"T\n", half, half]
    server = start_server(lambda _line: answers[len(server.lines) - 1])
    stub = start_stub(server.address, timeout_ms=LONG_MS)

    assert ["T", "TRUE"] == [stub.call("SET_DOOR_OPEN DOOR_1"), stub.call("DOOR_OPEN DOOR_1")]
    assert "FALSE" == stub.call("DOOR_OPEN DOOR_2")

    first, second, *questions = server.lines
    assert first == second
    assert [b"DOOR_OPEN DOOR_1"] * 2 + [b"DOOR_OPEN DOOR_2"] * 2 == questions
    assert "the connection was lost before the answer came" in stub.call("DOOR_MAP_PROBLEM")


def test_a_server_that_speaks_unasked_is_not_believed(
    start_stub: StartStub, start_server: StartServer
) -> None:
    """What lies there before the question is no answer to it."""
    server = start_server(lambda line: b"T\n" if b"DOOR_1" in line else b"NIL\n")
    stub = start_stub(server.address)
    assert "TRUE" == stub.call("DOOR_OPEN DOOR_1")

    server.connections[0].sendall(b"T\n")

    assert "FALSE" == stub.call("DOOR_OPEN DOOR_2")
    assert 2 == len(server.connections)


def test_a_server_that_comes_back_is_asked_again(start_stub: StartStub, tmp_path: Path) -> None:
    """Nobody there: NIL at once, however long the time-out."""
    stub = start_stub(f"unix:{tmp_path}/doors", timeout_ms=LONG_MS)
    assert ["FALSE", "FALSE"] == [stub.call("DOOR_OPEN DOOR_1") for _ in range(2)]

    for _ in range(2):
        with LineServer(lambda _line: b"T\n", tmp_path / "doors"):
            assert ["TRUE", "TRUE"] == [stub.call("DOOR_OPEN DOOR_1") for _ in range(2)]
        assert ["FALSE", "FALSE"] == [stub.call("DOOR_OPEN DOOR_1") for _ in range(2)]
        (tmp_path / "doors").unlink()

    said = re.findall(r"No such file|Connection refused|lost|answers again", stub.errors)
    assert ["No such file", "answers again", "Connection refused", "answers again"] == said[:4]


def test_a_frozen_server(start_stub: StartStub, tmp_path: Path) -> None:
    """SIGSTOP: its socket still takes connections. With SIGCONT it answers again."""
    program = Path(__file__).parent / "door_server.py"
    command = [sys.executable, program, f"unix:{tmp_path}/doors", tmp_path / "journal"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as server:
        try:
            assert server.stdout is not None
            assert b"ready\n" == server.stdout.readline()
            stub = start_stub(f"unix:{tmp_path}/doors", timeout_ms=1000)
            wait_until(lambda: stub.call("DOOR_OPEN DOOR_1") == "TRUE", "the server's answer")
            server.send_signal(signal.SIGSTOP)
            os.waitpid(server.pid, os.WUNTRACED)  # until it has stopped
            assert "FALSE" == stub.call("DOOR_OPEN DOOR_1")
            assert "no answer within 1000 ms" in stub.call("DOOR_MAP_PROBLEM")
            server.send_signal(signal.SIGCONT)
            wait_until(lambda: stub.call("DOOR_OPEN DOOR_1") == "TRUE", "the server's answer")
        finally:
            server.kill()  # one that is stopped, too


def test_a_queue_that_is_full(start_stub: StartStub, tmp_path: Path) -> None:
    """Nobody accepts: connecting has the same time-out as asking."""
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "doors"))
        listener.listen(0)
        waiting = [socket.socket(socket.AF_UNIX) for _ in range(4)]
        for one in waiting:
            one.setblocking(False)
            one.connect_ex(str(tmp_path / "doors"))
        stub = start_stub(f"unix:{tmp_path}/doors", timeout_ms=200)

        assert "FALSE" == stub.call("DOOR_OPEN DOOR_1")

        for one in waiting:
            one.close()
    assert "timed out" in stub.call("DOOR_MAP_PROBLEM")


def test_no_sigpipe(start_stub: StartStub, tmp_path: Path) -> None:
    """The server closes while a long question is written."""
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "doors"))
        listener.listen(16)
        listener.settimeout(DEADLINE_S)
        stub = start_stub(f"unix:{tmp_path}/doors", timeout_ms=LONG_MS)

        for _ in range(20):
            stub.send("WHY x" + "61" * 60_000)
            for _ in range(2):  # the question, and the question once more
                connection, _ = listener.accept()
                connection.recv(1)
                connection.close()
            assert "NIL" == stub.result()


def test_a_server_that_reads_no_more_ends_no_kernel(start_stub: StartStub, tmp_path: Path) -> None:
    """Where the first byte of a question cannot be written, it is sent over a new connection."""
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "doors"))
        listener.listen(16)
        listener.settimeout(DEADLINE_S)
        stub = start_stub(f"unix:{tmp_path}/doors", timeout_ms=LONG_MS)
        results, connections = [], []
        for _ in range(2):
            stub.send("WHY x61")
            connections.append(listener.accept()[0])
            with connections[-1].makefile("rb") as lines:
                assert b"why" in next(lines).lower()
            connections[-1].sendall(b"T\n")
            results.append(stub.result())
            connections[-1].shutdown(socket.SHUT_RD)

        assert results[0] == results[1] != "NIL"
        for connection in connections:
            connection.close()


def test_ten_thousand_questions_and_many_connections_leave_no_file_open(
    start_stub: StartStub, start_server: StartServer
) -> None:
    """As many descriptors as before."""
    server = start_server(lambda line: (b"T\n",) if b"WHY" in line else b"T\n")
    stub = start_stub(server.address, timeout_ms=LONG_MS)
    stub.call("DOOR_OPEN DOOR_1")
    before = stub.call("OPEN_FILES")

    assert "TRUE" == stub.call("REPEAT 10000 DOOR_OPEN DOOR_1")
    assert "T" == stub.call("REPEAT 200 WHY DOOR_1")
    stub.call("DOOR_OPEN DOOR_1")

    assert before == stub.call("OPEN_FILES")
    assert len(server.connections) > 100
    server.hang_up()
    for _ in range(10):
        stub.call(f'CONNECT_DOOR_MAP "{server.address}"')
    stub.call("DOOR_OPEN DOOR_1")
    assert before == stub.call("OPEN_FILES")


def test_a_standard_error_that_nobody_reads(
    start_stub: StartStub, start_server: StartServer
) -> None:
    """A pipe that is full: the kernel goes on, and the message is lost."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    server = start_server(lambda _line: b"T\n")
    stub = start_stub(server.address, stderr=writing)
    stub.call("DOOR_OPEN DOOR_1")
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(writing, b"x")
    os.set_blocking(writing, True)

    for number in range(100):
        assert "NIL" == stub.call(f"ASK_DOOR_MAP DOOR_{number} $X")
    assert "TRUE" == stub.call("DOOR_OPEN DOOR_1")

    os.close(reading)
    os.close(writing)


@pytest.mark.parametrize(
    ("between", "is_same"),
    [
        ([], True),
        (["DOOR_OPEN DOOR_1"], True),
        (["SET_DOOR_OPEN DOOR_2", "SET_OPEN_PROBABILITY DOOR_1 0.5"], True),
        (["SET_DOOR_CLOSED DOOR_1"], False),
        (["SET_DOOR_CLOSED DOOR_front"], False),
        (["REMOVE_DOOR DOOR_1"], False),
    ],
)
def test_an_action_that_had_no_answer_is_repeated_under_its_id(
    start_stub: StartStub, start_server: StartServer, between: list[str], is_same: bool
) -> None:
    """
    So the server stores it once; unless the same of that door was changed in between (a name may
    be that of any door): answering as the first time would then leave the door as it is.
    """
    server = start_server(lambda _line: b"T\n" if len(server.lines) > 2 else (b"",))
    stub = start_stub(server.address, timeout_ms=LONG_MS)
    assert "NIL" == stub.call("SET_DOOR_OPEN DOOR_1")

    for line in between:
        stub.call(line)
    assert ["T", "T"] == [stub.call("SET_DOOR_OPEN DOOR_1") for _ in range(2)]

    first, again, second, third = _ids(server, "SET_DOOR_OPEN DOOR_1")
    assert first == again
    assert is_same == (first == second)
    assert second != third


def test_the_last_64_such_actions_are_kept(
    start_stub: StartStub, start_server: StartServer
) -> None:
    """A plan that goes on to many doors while nothing is answered."""
    server = start_server(lambda _line: b"T\n" if len(server.lines) > 2 * 65 else (b"",))
    stub = start_stub(server.address, timeout_ms=LONG_MS)
    for number in range(65):
        assert "NIL" == stub.call(f"SET_DOOR_OPEN DOOR_{number}")

    assert ["T", "T"] == [stub.call(f"SET_DOOR_OPEN DOOR_{number}") for number in (64, 0)]

    kept, forgotten = (_ids(server, f"SET_DOOR_OPEN DOOR_{number}") for number in (64, 0))
    assert (1, 2) == (len(set(kept)), len(set(forgotten)))


def _ids(server: LineServer, action: str) -> list[bytes]:
    return [line.split(b" ")[0] for line in server.lines if line.endswith(b" " + action.encode())]


def test_what_was_answered_is_not_repeated(
    start_stub: StartStub, start_server: StartServer
) -> None:
    """NIL and ERROR are answers: the same action later is a new wish."""
    answers = iter([b"NIL\n", b'ERROR "disk full"\n'])
    server = start_server(lambda _line: next(answers, b"T\n"))
    stub = start_stub(server.address)

    assert ["NIL", "NIL", "T"] == [stub.call("REMOVE_DOOR DOOR_1") for _ in range(3)]
    assert 3 == len({line.split(b" ")[0] for line in server.lines})


def test_tcp_with_a_token(start_stub: StartStub, tmp_path: Path) -> None:
    """The token is the first line of each connection, read from its file each time."""
    token = tmp_path / "token"
    with LineServer(lambda line: b"T\n" if b"bad" not in line else b"NIL\n") as server:
        stub = start_stub(server.address, {"SEMMAP_ASK_TOKEN_FILE": str(token)})
        assert "FALSE" == stub.call("DOOR_OPEN DOOR_1")
        assert f"token file {token}: No such file" in stub.call("DOOR_MAP_PROBLEM")
        token.write_text("bad one\n", encoding="utf-8")
        assert "FALSE" == stub.call("DOOR_OPEN DOOR_1")
        assert "refused the token" in stub.call("DOOR_MAP_PROBLEM")
        token.write_text("s3cret\n", encoding="utf-8")
        assert "TRUE" == stub.call("DOOR_OPEN DOOR_1")
        assert "TRUE" == stub.call("DOOR_OPEN DOOR_1")

    assert [
        b'TOKEN "bad one"', b"TOKEN s3cret", b"DOOR_OPEN DOOR_1", b"DOOR_OPEN DOOR_1",
    ] == server.lines  # fmt: skip


def test_an_address_can_be_given_later(start_stub: StartStub, start_server: StartServer) -> None:
    """By an action; without any, each question says what to do."""
    server = start_server(lambda _line: b"T\n")
    stub = start_stub(None)

    assert "FALSE" == stub.call("DOOR_MAP_ANSWERS")
    assert "set SEMMAP_ASK" in stub.call("DOOR_MAP_PROBLEM")
    assert "T" == stub.call(f'CONNECT_DOOR_MAP "{server.address}"')
    assert ["TRUE", "TRUE"] == [stub.call("DOOR_MAP_ANSWERS"), stub.call("DOOR_OPEN DOOR_1")]
    assert "NIL" == stub.call('CONNECT_DOOR_MAP "unix:/nowhere/doors"')
    assert "FALSE" == stub.call("DOOR_OPEN DOOR_1")


@pytest.mark.parametrize(
    ("address", "problem"),
    [
        ("doors", "expected unix:PATH or tcp:HOST:PORT"),
        ("", "expected unix:PATH or tcp:HOST:PORT"),
        ("unix:", "expected a path"),
        ("unix:" + "a" * 200, "longer than a Unix socket's"),
        ("unix:" + "a" * 5000, "it is too long"),
        ("tcp:127.0.0.1", "expected tcp:HOST:PORT"),
        ("tcp:127.0.0.1:", "expected tcp:HOST:PORT"),
        ("tcp::7000", "expected tcp:HOST:PORT"),
        ("tcp:doors.example.org:7000", "names are not looked up"),
        ("tcp:127.0.0.1:http", "names are not looked up"),
        ("tcp:" + "1" * 100 + ":7000", "no number such as 127.0.0.1"),
    ],
)
def test_addresses_that_are_none(start_stub: StartStub, address: str, problem: str) -> None:
    """Said when the kernel starts, and at each question."""
    stub = start_stub(None, {"SEMMAP_ASK": address})

    assert "FALSE" == stub.call("DOOR_OPEN DOOR_1")

    assert problem in stub.errors
    assert problem in stub.call("DOOR_MAP_PROBLEM")


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1"])
def test_hosts(start_stub: StartStub, host: str) -> None:
    """The loopback device by both its names."""
    with LineServer(lambda _line: b"T\n") as server:
        stub = start_stub(server.address.replace("127.0.0.1", host))
        assert "TRUE" == stub.call("DOOR_OPEN DOOR_1")


@pytest.mark.parametrize("timeout", ["0", "-1", "", "soon", "600001", "99999999999999999999"])
def test_time_outs_that_are_none(
    start_stub: StartStub, start_server: StartServer, timeout: str
) -> None:
    """The usual one stays."""
    server = start_server(lambda _line: b"T\n")
    stub = start_stub(server.address, {"SEMMAP_ASK_TIMEOUT_MS": timeout})

    assert "TRUE" == stub.call("DOOR_OPEN DOOR_1")
    assert "expected 1 to 600000; it stays 2000" in stub.errors
