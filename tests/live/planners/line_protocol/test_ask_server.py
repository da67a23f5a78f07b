"""The server of questions: many clients, hostile ones, silent ones, and its end."""

from __future__ import annotations

import contextlib
import json
import os
import random
import resource
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.errors import AddressError, QuestionError
from semmap_log.live.planners.addresses import read_address
from semmap_log.live.planners.door_view import STATE_QUESTIONS, LearntDoors
from semmap_log.live.planners.line_protocol import ask_server
from semmap_log.live.planners.line_protocol import connection as connection_module
from semmap_log.live.planners.line_protocol.ask_server import MOST_KNOWN_LINES, AskServer
from semmap_log.live.planners.line_protocol.connection import MOST_ANSWERS_BYTES, Connection
from semmap_log.live.planners.line_protocol.tokens import AskClient
from semmap_log.live.planners.oracle import Wait
from semmap_log.live.planners.question_lines import (
    MOST_LINE_BYTES,
    Answer,
    Atom,
    Value,
    is_answer,
    read_line,
    write_answer,
    write_error,
)
from tests.live.oprs.line_server import LineServer
from tests.live.planners.asker import Asker
from tests.live.planners.line_protocol.running_server import Raw, serving, unix_in
from tests.live.ros.running import wait_until

TOKEN = "a-token-of-many-letters"


@pytest.fixture
def server(ask: Asker, tmp_path: Path) -> Iterator[AskServer]:
    with serving(ask, unix_in(tmp_path)) as running:
        yield running


@pytest.fixture
def client(server: AskServer) -> Iterator[Raw]:
    with Raw(server.address) as raw:
        yield raw


def test_each_sort_of_question_over_the_socket(client: Raw) -> None:
    """At once, looked up, done, waited for; in words and in JSON."""
    assert client.ask("DOOR_OPEN DOOR_1") == "T"
    assert client.ask("DOOR_OPEN DOOR_1 now") == "T"
    assert client.ask("SET_DOOR_CLOSED DOOR_1") == "T"
    assert client.ask("DOOR_OPEN DOOR_1") == "NIL"
    assert client.ask("WAIT_UNTIL DOOR_1 CLOSED 5") == "T"
    assert client.ask("WAIT_UNTIL DOOR_1 OPEN 0.01") == "NIL"
    assert client.ask('{"ask": "DOOR_STATE", "args": [1], "id": 4}') == (
        '{"answer": "CLOSED", "id": 4}'
    )
    assert client.ask("FOO").startswith('ERROR "')
    assert json.loads(client.ask('{"ask": "FOO", "id": 5}'))["id"] == 5
    assert client.ask("DOOR_OPEN DOOR_2\r") == "NIL"


def test_answers_come_in_the_order_of_the_questions(client: Raw) -> None:
    """Sent in one go, slow and quick ones mixed: each sees what those before it did."""
    lines, expected, is_open = [], [], True
    dice = random.Random(3)
    for _ in range(200):
        kind = dice.randrange(4)
        if kind == 0:
            is_open = not is_open
            lines.append("SET_DOOR_OPEN DOOR_1" if is_open else "SET_DOOR_CLOSED DOOR_1")
            expected.append("T")
        elif kind == 3:
            lines.append("WAIT_UNTIL DOOR_1 OPEN 0")
            expected.append("T" if is_open else "NIL")
        else:
            lines.append("DOOR_OPEN DOOR_1" if kind == 1 else "BELIEVED DOOR_OPEN DOOR_1 AT now")
            expected.append("T" if is_open else "NIL")

    client.send("".join(f"{line}\n" for line in lines).encode())

    assert expected == [client.line() for _ in lines]


def test_who_is_at_the_other_end_of_a_socket_is_told(ask: Asker, client: Raw) -> None:
    """In the note of what was done."""
    client.ask("SET_DOOR_CLOSED DOOR_1")

    commit = list(ask.doors.log.commits())[-1]
    assert f"SET_DOOR_CLOSED from pid {os.getpid()}" == commit.note.source


@pytest.mark.parametrize(
    ("sent", "problem"),
    [
        (b"x" * MOST_LINE_BYTES + b"\n", "expected a line of at most 65,536 bytes"),
        (b"x" * (5 * MOST_LINE_BYTES) + b"\n", "expected a line of at most 65,536 bytes"),
        (b"{" + b"x" * (5 * MOST_LINE_BYTES) + b"\n", "expected a line of at most 65,536 bytes"),
        (b"DOOR_OPEN DOOR_1\0\n", "without control characters"),
        (b"DOOR_OPEN \xff\xfe\n", "expected UTF-8 text"),
        (b"\n", "got none"),
        (b"\r\n", "got none"),
        (b"GET / HTTP/1.1\r\n", "'GET' is no question"),
        (b"\x16\x03\x01\x02\x00\n", "control characters"),
    ],
)
def test_a_bad_line_is_one_error_and_the_next_is_answered(
    client: Raw, sent: bytes, problem: str
) -> None:
    """However long, and in however many pieces."""
    client.send(sent + b"DOOR_OPEN DOOR_1\n")

    assert problem in client.line()
    assert client.line() == "T"


def test_a_line_comes_in_pieces(client: Raw) -> None:
    """As TCP cuts it: byte by byte, two at a time."""
    data = b"DOOR_OPEN DOOR_1\nDOOR_OPEN DOOR_2\n" * 3
    for size in (1, 2, 7, 20):
        for at in range(0, len(data), size):
            client.send(data[at : at + size])
            time.sleep(0)
        assert ["T", "NIL"] * 3 == [client.line() for _ in range(6)]


def test_half_a_line_does_nothing(ask: Asker, server: AskServer) -> None:
    """Whoever leaves in the middle of an action has not asked for it; who only ends is told."""
    with Raw(server.address) as left:
        left.send(b"REMOVE_DOOR DOOR_1")
    with Raw(server.address) as ended:
        ended.send(b"DOOR_OPEN DOOR_1\nREMOVE_DOOR DOOR_1")
        ended.half_close()
        said = [ended.line(), ended.line(), ended.line()]

    assert ["T", 'ERROR "expected a line end, got none"', ""] == said
    assert ask("DOOR_STATE_KNOWN DOOR_1") == "T"


def test_a_line_without_an_end_is_not_kept(server: AskServer) -> None:
    """It is refused as soon as it is too long; what follows belongs to it."""
    with Raw(server.address) as client:
        client.send(b"x" * (10 * MOST_LINE_BYTES))
        client.half_close()

        assert "at most 65,536 bytes" in client.line()
        assert client.line() == ""


def test_broken_lines_in_json_are_answered_in_json(server: AskServer) -> None:
    """As far as one can tell: by how they began."""
    with Raw(server.address) as client:
        client.send(b'{"' + b"x" * (2 * MOST_LINE_BYTES) + b'\n{"ask": "DOORS"')
        client.half_close()
        said = [json.loads(client.line())["error"] for _ in range(2)]

    assert ["expected a line of at most 65,536 bytes, got a longer one",
            "expected a line end, got none"] == said  # fmt: skip


def test_who_ends_after_asking_gets_all_answers(server: AskServer) -> None:
    """As `printf … | nc -N -U` does, with a question that waits among them."""
    with Raw(server.address) as client:
        client.send(b"DOOR_OPEN DOOR_1\nWAIT_UNTIL DOOR_1 CLOSED 0.05\nSET_DOOR_OPEN DOOR_2\n")
        client.half_close()

        assert ["T", "NIL", "T", ""] == [client.line() for _ in range(4)]


_pieces = st.lists(
    st.binary(max_size=50)
    | st.sampled_from([b"DOOR_OPEN DOOR_1\n", b"\n", b'{"ask"', b"WAIT_UNTIL DOOR_1 CLOSED 0\n",
                       b"x" * 70_000, b'"', b"\r\n", b"\0", b"#", b"AT ", b"DOORS\n", b"HELP\n"])
)  # fmt: skip


@given(pieces=_pieces)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_bytes_get_a_line_for_each_line(server: AskServer, pieces: list[bytes]) -> None:
    """And one for what is left behind the last; then the next client is answered."""
    data = b"".join(pieces)
    with Raw(server.address) as client:
        threading.Thread(target=lambda: (client.send(data), client.half_close())).start()
        said = []
        while line := client.line():
            said.append(line)

    assert len(data.removesuffix(b"\n").split(b"\n")) * bool(data) == len(said)
    assert all(line.isprintable() for line in said)
    with Raw(server.address) as another:
        assert another.ask("DOOR_OPEN DOOR_1") == "T"


def test_a_client_that_never_reads_holds_up_nobody_and_takes_little_memory(
    server: AskServer,
) -> None:
    """It is asked nothing more once its answers pile up."""
    question, count = b"HELP\n", 3000
    with Raw(server.address) as silent, Raw(server.address) as other:
        sending = threading.Thread(target=lambda: silent.send(question * count))
        sending.start()
        wait_until(lambda: any(each.is_full for each in server._connections), "it is full")
        assert [other.ask("DOOR_OPEN DOOR_1") for _ in range(100)] == ["T"] * 100
        (full,) = [each for each in server._connections if each.is_full]
        assert len(full._answers) < 2 * MOST_ANSWERS_BYTES
        answers = {silent.line() for _ in range(count)}
        sending.join()

    assert 1 == len(answers)


def test_a_slow_question_holds_up_nobody(
    ask: Asker, server: AskServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not even as many as are looked up at a time, and more: actions go on, too."""
    going_on, log = threading.Event(), ask.doors.log
    replay, held_up = log.replay, list[object]()

    def slow_replay(**moment: object) -> object:
        if not going_on.wait(30):
            held_up.append(moment)
        return replay(**moment)

    monkeypatch.setattr(log, "replay", slow_replay)
    slow = [Raw(server.address) for _ in range(10)]
    for each in slow:
        each.send(b"DOOR_OPEN DOOR_1 event:1\n")
    with Raw(server.address) as other:
        said = [other.ask("DOOR_OPEN DOOR_1"), other.ask("SET_DOOR_OPEN DOOR_2")]
    going_on.set()

    assert (["T", "T"], []) == (said, held_up)
    assert ["T"] * 10 == [each.line() for each in slow]
    for each in slow:
        each.close()


LONG_LINES = {
    "a door many times": b"NEXT_DOOR " + b"DOOR_1 " * 9000,
    "a key twice": b"{" + b",".join(b'"%d":0' % n for n in [*range(6000), 5999]) + b"}",
    "questions in questions": b"BELIEVED " * 3000 + b"DOORS" + b" AT now" * 3000,
    "doors that are none": b"NEXT_DOOR " + b" ".join(b"x%d" % n for n in range(900)),
}


@pytest.mark.parametrize("name", LONG_LINES)
def test_long_lines_are_read_by_another_thread(
    name: str, ask: Asker, client: Raw, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And answered in their order, as those before and after them."""
    readers: list[str] = []

    def read(data: bytes) -> object:
        readers.append(threading.current_thread().name)
        return read_line(data)

    monkeypatch.setattr(ask_server, "read_line", read)
    client.send(b"DOOR_OPEN DOOR_1\n" + LONG_LINES[name] + b"\nDOOR_CLOSED DOOR_1\n")

    answers = [client.line() for _ in range(3)]
    assert ("T", "NIL") == (answers[0], answers[2])
    assert answers[1] == "NIL" or answers[1].startswith(("ERROR ", '{"error": '))
    assert ["ask", "ask-reading", "ask"] == readers
    assert [] == ask.said


def test_what_is_likely_holds_up_nobody(
    ask: Asker, server: AskServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who asks about what was so, or what is so."""
    going_on = threading.Event()
    monkeypatch.setattr(LearntDoors, "p_open", lambda *_, **__: (float(going_on.wait(30)), True))
    likely = [Raw(server.address) for _ in range(5)]
    for each in likely:
        each.send(b"NEXT_DOOR DOOR_1 DOOR_2\n")
    with Raw(server.address) as other:
        said = [other.ask("DOOR_OPEN DOOR_1 event:1"), other.ask("DOOR_OPEN DOOR_1")]
    assert not going_on.is_set()
    going_on.set()

    assert ["T", "T"] == said
    assert ["DOOR_1"] * 5 == [each.line() for each in likely]
    for each in likely:
        each.close()


def test_a_question_of_many_doors_is_answered_by_turns(
    ask: Asker, server: AskServer, client: Raw, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another client's door comes after the first of them."""
    looked_at: list[int] = []

    def p_open(_: object, log: object, event: int, door: int, **times: int) -> tuple[float, bool]:
        if not looked_at:
            other.send(b"PROBABILITY_DOOR_OPEN DOOR_5 AT now\n")
            wait_until(lambda: server._forecasts._waiting, "the other's question")
        looked_at.append(door)
        return 0.5, True

    monkeypatch.setattr(LearntDoors, "p_open", p_open)
    with Raw(server.address) as other:
        assert "DOOR_1" == client.ask("NEXT_DOOR DOOR_1 DOOR_2 DOOR_3 DOOR_4")
        assert "0.5" == other.line()

    assert [1, 5, 2, 3, 4] == looked_at


def test_many_lines_at_once_hold_up_nobody(
    server: AskServer, client: Raw, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where their turn is over at once, one is answered before the others have theirs."""
    takes: list[Connection] = []
    take = server._take

    def watched(connection: Connection, data: bytes) -> None:
        if not takes:
            other.send(b"DOOR_OPEN DOOR_2\n")
        takes.append(connection)
        take(connection, data)

    monkeypatch.setattr(ask_server, "TURN_S", 0.0)
    monkeypatch.setattr(server, "_take", watched)
    with Raw(server.address) as other:
        client.send(b"DOOR_OPEN DOOR_1\n" * 500)
        assert "NIL" == other.line()
        assert {"T"} == {client.line() for _ in range(500)}

    assert 501 == len(takes)
    assert takes.index(next(each for each in takes if each is not takes[0])) < 10


def test_two_hundred_clients(ask: Asker, server: AskServer) -> None:
    """Each sets, asks and waits; all are answered, and each action is one commit."""
    clients = [Raw(server.address) for _ in range(200)]
    before = len(list(ask.doors.log.commits()))
    waiting, acting = clients[:100], clients[100:]
    for each in waiting:
        each.send(b"WAIT_UNTIL DOOR_4 OPEN 60\n")
    for i, each in enumerate(acting):
        each.send(f"SET_OPEN_PROBABILITY DOOR_1 {i / 1000}\nDOOR_OPEN DOOR_1\n".encode())
    assert [("T", "T")] * 100 == [(each.line(), each.line()) for each in acting]
    wait_until(lambda: len(ask.oracle._waits._waiting) == 100, "all wait")
    acting[0].ask("SET_DOOR_OPEN DOOR_4")

    assert ["T"] * 100 == [each.line() for each in waiting]
    for each in clients:
        each.close()
    wait_until(lambda: not server._connections, "all are gone")
    assert 2 == len(server._selector.get_map())
    assert 101 == len(list(ask.doors.log.commits())) - before + ask("DOOR_OPEN DOOR_9").count("T")


def test_a_thousand_connections_and_one_more(server: AskServer, monkeypatch) -> None:
    """All are answered; who comes later is told so, and let in when one has left."""
    clients = []
    try:
        for _ in range(1000):
            clients.append(Raw(server.address))  # noqa: PERF401  those that are there are closed
        assert ["T"] * 1000 == [each.ask("DOOR_OPEN DOOR_1") for each in clients]
        with Raw(server.address) as late:
            assert late.line() == 'ERROR "1,000 clients are here; come later"'
            assert late.line() == ""
        clients.pop().close()
        wait_until(lambda: len(server._connections) < 1000, "one has left")
        with Raw(server.address) as late:
            assert late.ask("DOOR_OPEN DOOR_1") == "T"
    finally:
        for each in clients:
            each.close()


def test_no_more_files(server: AskServer, client: Raw) -> None:
    """Who cannot be let in is told why; who is there goes on; later ones are let in again."""
    assert client.ask("DOOR_OPEN DOOR_1") == "T"
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    late = socket.socket(socket.AF_UNIX)
    highest = late.fileno() + 1
    fillers = []
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (highest, before[1]))
        with contextlib.suppress(OSError):
            while True:
                fillers.append(os.dup(0))
        late.settimeout(10)
        late.connect(server.address.removeprefix("unix:"))
        said = late.recv(1000)
        assert client.ask("DOOR_OPEN DOOR_1") == "T"
    finally:
        for each in fillers:
            os.close(each)
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
        late.close()

    assert b'ERROR "the server cannot open more files; come later"\n' == said
    with Raw(server.address) as another:
        assert another.ask("DOOR_OPEN DOOR_1") == "T"


def test_lines_that_are_known_have_a_bound(server: AskServer, client: Raw) -> None:
    """Those with a command id never come again, long ones take room."""
    client.ask(f"#{'0' * 32} SET_DOOR_OPEN DOOR_1")
    client.ask(f"DOOR_OPEN {'x' * 1000}")
    assert {} == server._known_lines
    for i in range(MOST_KNOWN_LINES + 10):
        client.ask(f"DOOR_OPEN DOOR_{i}")

    assert 0 < len(server._known_lines) <= MOST_KNOWN_LINES


def test_waits_leave_nothing_behind(ask: Asker, server: AskServer, client: Raw) -> None:
    """Neither those that ended early, thousands of them, nor that of a client that has left."""
    client.send(b"WAIT_UNTIL DOOR_1 OPEN 80000\n" * 2000)
    assert ["T"] * 2000 == [client.line() for _ in range(2000)]
    assert len(server._deadlines) < 100
    with Raw(server.address) as leaving:
        leaving.send(b"WAIT_UNTIL DOOR_1 CLOSED 80000\n")
        wait_until(lambda: ask.oracle._waits._waiting, "the wait")

    wait_until(lambda: not ask.oracle._waits._waiting, "its end")


def test_deadlines_are_met_each_at_its_time(client: Raw, server: AskServer) -> None:
    """A short wait behind a long one is not kept for it."""
    client.send(b"WAIT_UNTIL DOOR_1 CLOSED 80000\n")
    with Raw(server.address) as other:
        assert [other.ask(f"WAIT_UNTIL DOOR_1 CLOSED 0.0{i}") for i in (3, 1, 2)] == ["NIL"] * 3


def test_the_end_answers_what_was_begun(ask: Asker, tmp_path: Path) -> None:
    """
    An action that runs is finished and answered, one that waits in the line is not begun, a wait
    is over; the file is gone.
    """
    begun, going_on = threading.Event(), threading.Event()
    append = ask.doors.append

    def slow_append(*values: object, **more: object) -> object:
        begun.set()
        going_on.wait(60)
        return append(*values, **more)

    ask.doors.append = slow_append
    with serving(ask, unix_in(tmp_path)) as server:
        acting, waiting = Raw(server.address), Raw(server.address)
        acting.send(b"SET_DOOR_CLOSED DOOR_1\nSET_DOOR_OPEN DOOR_2\n")
        waiting.send(b'{"ask": "WAIT_UNTIL", "args": [1, "MOVING", 30]}\n')
        begun.wait(60)
        wait_until(lambda: ask.oracle._waits._waiting, "the wait")
        closing = threading.Thread(target=server.close)
        closing.start()
        assert "the server ends." == json.loads(waiting.line())["reason"]
        assert waiting.line() == ""
        going_on.set()
        closing.join(60)
        said = [acting.line(), acting.line()]

    assert ["T", ""] == said
    assert ("CLOSED", "CLOSED") == (ask("DOOR_STATE DOOR_1"), ask("DOOR_STATE DOOR_2"))
    assert not (tmp_path / "s").exists()
    assert ask.oracle._waits._waiting == set()
    acting.close()
    waiting.close()


def test_the_end_does_not_wait_for_who_never_reads(
    ask: Asker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A few seconds, and it is let go of."""
    monkeypatch.setattr(ask_server, "CLOSE_WITHIN_S", 0.05)
    with serving(ask, unix_in(tmp_path)) as server:
        silent = Raw(server.address)
        threading.Thread(target=lambda: _send(silent, b"HELP\n" * 5000), daemon=True).start()
        wait_until(lambda: any(each.is_full for each in server._connections), "it is full")
    silent.close()

    assert not (tmp_path / "s").exists()


def _send(client: Raw, data: bytes) -> None:
    with contextlib.suppress(OSError):
        client.send(data)


def test_an_error_of_our_own_is_told_and_survived(ask: Asker, client: Raw, monkeypatch) -> None:
    """Who asked gets a line, who runs the server the trace."""
    with monkeypatch.context() as broken:
        broken.setattr(ask.oracle, "_look_up", lambda _: 1 / 0)
        broken.setitem(STATE_QUESTIONS, "DOOR_CLOSED", lambda *_: 1 / 0)
        for line in ("DOOR_OPEN DOOR_1 now", "DOOR_CLOSED DOOR_1"):
            assert client.ask(line) == 'ERROR "ZeroDivisionError: division by zero"'
    assert [True, True] == ["Traceback" in said for said in ask.said]
    assert client.ask("DOOR_OPEN DOOR_1") == "T"


def test_a_server_that_fails_says_so(
    ask: Asker, server: AskServer, client: Raw, monkeypatch
) -> None:
    """Whoever runs it must not believe that it answers."""
    monkeypatch.setattr(server, "_serve", lambda *_: 1 / 0)
    client.send(b"DOOR_OPEN DOOR_1\n")

    wait_until(lambda: server.failure, "the failure")

    with contextlib.suppress(ConnectionResetError):  # it was let go of, one way or another
        assert client.line() == ""
    assert isinstance(server.failure, ZeroDivisionError)
    assert "Traceback" in ask.said[0]


def test_a_full_disk_refuses_an_action_and_nothing_else(
    ask: Asker, client: Raw, path: Path
) -> None:
    """NIL with the reason, nothing half; with room again the same command is done, once."""
    line = f"#{'ab' * 16} SET_DOOR_CLOSED DOOR_1"
    assert client.ask("SET_OPEN_PROBABILITY DOOR_1 0.5") == "T"
    (segment,) = path.glob("*.mcap")
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (segment.stat().st_size + 50, limit[1]))
    try:
        refused = client.ask(line)
        asked = [client.ask("DOOR_OPEN DOOR_1"), client.ask("DOOR_OPEN DOOR_1 now")]
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    done = [client.ask(line), client.ask(line), client.ask("DOOR_OPEN DOOR_1")]

    assert ("NIL", ["T", "T"], ["T", "T", "NIL"]) == (refused, asked, done)
    assert "the log could not be written" in ask.said[0]
    ask.doors.close()
    stored = [each for each in sl.read(path).commits() if each.command_id == b"\xab" * 16]
    assert 1 == len(stored)


def test_tcp_with_a_token(ask: Asker) -> None:
    """The first line is it, or an error and the end; nothing is answered before."""
    with serving(ask, "tcp:127.0.0.1:0", token=TOKEN) as server:
        with Raw(server.address) as client:
            assert client.ask(f"TOKEN {TOKEN}") == "T"
            assert client.ask("DOOR_OPEN DOOR_1") == "T"
            assert client.ask("SET_DOOR_CLOSED DOOR_1") == "T"
        assert "from 127.0.0.1:" in list(ask.doors.log.commits())[-1].note.source
        for first in (f"TOKEN {TOKEN}x", "TOKEN", "", f"token {TOKEN}", "DOOR_OPEN DOOR_1", "{}"):
            with Raw(server.address) as client:
                assert client.ask(first).startswith("ERROR \"expected TOKEN and the server's token")
                assert client.line() == ""
        with Raw(server.address) as client:
            client.send(b"TOKEN wrong\nSET_DOOR_OPEN DOOR_2\n")
            client.line()
            assert client.line() == ""
        assert ask("DOOR_OPEN DOOR_2") == "NIL"


def test_who_does_not_say_who_it_is_leaves(ask: Asker, monkeypatch: pytest.MonkeyPatch) -> None:
    """Or strangers would take all the places."""
    monkeypatch.setattr(ask_server, "TOKEN_WITHIN_S", 0.05)
    with serving(ask, "tcp:127.0.0.1:0", token=TOKEN) as server, Raw(server.address) as client:
        assert "the server's token first" in client.line()
        assert client.line() == ""
        with Raw(server.address) as known:
            known.ask(f"TOKEN {TOKEN}")
            time.sleep(0.1)
            assert known.ask("DOOR_OPEN DOOR_1") == "T"


def test_no_token_where_none_is_wanted(ask: Asker) -> None:
    """Whoever sends one is told."""
    with serving(ask, "tcp:127.0.0.1:0") as server, Raw(server.address) as client:
        assert client.ask(f"TOKEN {TOKEN}").startswith("ERROR")
        assert client.ask("DOOR_OPEN DOOR_1") == "T"


def test_the_client(server: AskServer) -> None:
    """One question after the other; a line end within is refused, since it would be two."""
    with AskClient(read_address(server.address)) as client:
        assert ["T", "NIL"] == [client.ask(f"DOOR_OPEN DOOR_{i}") for i in (1, 2)]
        with pytest.raises(sl.SemmapError, match="on one line"):
            client.ask("DOOR_OPEN DOOR_1\nREMOVE_DOOR DOOR_1")
        assert client.ask("DOOR_OPEN DOOR_1") == "T"


def test_the_client_of_a_server_that_goes(ask: Asker, tmp_path: Path) -> None:
    """An error that says so; so is an answer that does not come."""
    with serving(ask, unix_in(tmp_path)) as server:
        client = AskClient(read_address(server.address))
        hasty = AskClient(read_address(server.address), timeout_s=0.05)
        with pytest.raises(sl.SemmapError, match=r"no answer within 0\.05 s"):
            hasty.ask("WAIT_UNTIL DOOR_1 CLOSED 60")
        address = server.address
    with pytest.raises(sl.SemmapError, match="the server has gone"):
        client.ask("DOOR_OPEN DOOR_1")
    with pytest.raises(sl.SemmapError, match="no server answers there"):
        AskClient(read_address(address))
    client.close()
    hasty.close()


@pytest.mark.parametrize("said", ["<!DOCTYPE HTML>", "SSH-2.0-OpenSSH_9.2\r", "", "-ERR", "\xff"])
def test_another_program_that_answers(tmp_path: Path, said: str) -> None:
    """What it says is not taken for an answer."""
    with LineServer(lambda _: f"{said}\n".encode("latin-1"), tmp_path / "other") as other:
        client = AskClient(read_address(other.address))
        with pytest.raises(sl.SemmapError, match=r"other: another program listens there: expected"):
            client.ask("DOORS")
        client.close()


@pytest.mark.parametrize(
    "value", [True, None, 0.5, 5e-324, -1, 10**30, "", "a b", [], ["x", 1.0], Atom("DOOR_1")]
)
def test_what_is_an_answer(value: Value) -> None:
    """All that a server can say."""
    asked = read_line(b"DOORS")

    for line in (asked, replace(asked, is_json=True)):
        assert is_answer(write_answer(line, Answer(value)).decode()[:-1])
        assert is_answer(write_error("why", is_json=line.is_json).decode()[:-1])


DIGITS = "1" * 900
"""More than an id has."""


@pytest.mark.parametrize("question", ["DOOR_OPEN", "WAIT_UNTIL", "WHY", "SET_DOOR_OPEN"])
def test_a_door_of_too_many_digits(question: str, client: Raw) -> None:
    """There is none, and the server goes on."""
    more = " OPEN 1" if question == "WAIT_UNTIL" else ""

    assert client.ask(f"{question} {DIGITS}{more}") == "NIL"
    assert client.ask("DOOR_OPEN DOOR_1") == "T"


def test_a_wait_that_fails_harms_nobody(
    client: Raw, ask: Asker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By an error of our own: who asked is told, the others are served, and nothing waits on."""

    def fail(*_: object) -> None:
        raise RuntimeError("of a test")

    monkeypatch.setattr(Wait, "answer_in", fail)
    assert client.ask("WAIT_UNTIL DOOR_1 CLOSED 5") == 'ERROR "RuntimeError: of a test"'
    monkeypatch.undo()

    assert client.ask("SET_DOOR_CLOSED DOOR_1") == "T"
    assert client.ask("WAIT_UNTIL DOOR_1 CLOSED 5") == "T"
    assert not ask.oracle._waits._waiting


def test_clients_leave_files_for_the_log(
    ask: Asker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some numbers of files no client gets: an action, and what reads the log, need them."""
    with contextlib.ExitStack() as files:  # what other tests have open may lie between
        numbers = [files.enter_context(Path(os.devnull).open()).fileno() for _ in range(40)]
    monkeypatch.setattr(connection_module, "_allow_files", lambda _: max(numbers))
    with serving(ask, unix_in(tmp_path)) as server, contextlib.ExitStack() as clients:
        told = [""]
        while len(told) < 500 and not told[-1].startswith("ERROR"):
            client = clients.enter_context(Raw(server.address))
            with contextlib.suppress(ConnectionError):  # refused before it has asked
                client.send(b"DOOR_OPEN DOOR_1\n")
            with contextlib.suppress(ConnectionError):
                told.append(client.line())

    assert "T" == told[1]
    assert 'ERROR "the server cannot open more files; come later"' == told[-1]


def test_some_files_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of few, a quarter; of many, so many as the log wants at most."""
    for limit, most in (((64, 64), 48), ((256, 1000), 936), ((5000, 9000), 4936)):
        monkeypatch.setattr(resource, "getrlimit", lambda _, limit=limit: limit)
        monkeypatch.setattr(resource, "setrlimit", lambda *_: None)
        assert most == connection_module._allow_files(1200)


def test_a_client_that_asked_more_and_died(
    ask: Asker, server: AskServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While it waited for a door: nobody reads what it has sent."""
    monkeypatch.setattr(ask_server, "UNHEARD_S", 0.01)
    with Raw(server.address) as leaving:
        leaving.send(b"WAIT_UNTIL DOOR_1 CLOSED 80000\nDOORS\n")
        wait_until(lambda: server._unheard, "both lines")

    wait_until(lambda: not server._connections, "its end")
    assert not ask.oracle._waits._waiting
    assert not server._unheard


def test_no_late_answer_is_taken_for_the_next(server: AskServer) -> None:
    """After a time-out the connection is closed."""
    with AskClient(read_address(server.address), timeout_s=0.05) as hasty:
        with pytest.raises(AddressError, match=r"no answer within 0\.05 s"):
            hasty.ask("WAIT_UNTIL DOOR_1 CLOSED 0.1")
        with pytest.raises(AddressError, match="the connection is closed; connect again"):
            hasty.ask("SET_DOOR_CLOSED DOOR_1")

    with AskClient(read_address(server.address)) as client:
        assert "T" == client.ask("DOOR_OPEN DOOR_1")
        with pytest.raises(QuestionError, match=r"expected UTF-8 text, got .* at 11"):
            client.ask("DOOR_OPEN \udcff")
        assert "T" == client.ask("DOOR_OPEN DOOR_1")


def test_a_machine_that_is_gone_without_a_word(ask: Asker) -> None:
    """The system asks a silent one whether it is there; else it would keep its place for ever."""
    with serving(ask, "tcp:127.0.0.1:0") as server, Raw(server.address) as client:
        assert client.ask("DOOR_OPEN DOOR_1") == "T"
        (connection,) = server._connections

        assert connection.socket.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
