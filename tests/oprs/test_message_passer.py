"""The client of OpenPRS's message passer: in this process, and through the real one."""

from __future__ import annotations

import json
import socket
import struct
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.oprs.expressions import Expression, ExpressionError, Symbol
from semmap_log.oprs.message_passer import (
    MOST_BYTES,
    Message,
    MessageBuffer,
    PasserClient,
    PasserError,
    message_to,
    message_to_all,
    registration,
)
from tests.live.network_namespace import NetworkNamespace, NoNamespaceError
from tests.live.running import DEADLINE_S, wait_until
from tests.oprs.passer import Passer
from tests.oprs.workshop import Workshop

HELLO = Expression(Symbol("HELLO"))


def test_bytes() -> None:
    """
    As src/mp-register.c and src/send-message.c have them.
    """
    assert b"\0\0\0\1\0\0\0\2K1" == registration("K1")
    assert b"\0\0\0\1\0\0\0\2K1\0\0\0\7(HELLO)" == message_to("K1", HELLO)
    assert b"\0\0\0\2\0\0\0\7(HELLO)" == message_to_all(HELLO)


def _bytes_of(sender: str, text: str) -> bytes:
    parts = [each.encode() for each in (sender, text)]
    return b"".join(struct.pack(">I", len(part)) + part for part in parts)


TEXTS = st.text(st.characters(exclude_categories=["Cs"]))


@given(messages=st.lists(st.tuples(TEXTS, TEXTS), max_size=5), data=st.data())
def test_messages_however_they_are_cut(
    messages: list[tuple[str, str]], data: st.DataObject
) -> None:
    """
    Byte by byte or several at once: the same messages, in order.
    """
    stream = b"".join(_bytes_of(*message) for message in messages)
    cuts = data.draw(st.lists(st.integers(0, len(stream)), max_size=8).map(sorted))
    reader, found = MessageBuffer(), []

    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        reader.feed(stream[start:end])
        found += list(reader)

    assert [Message(*message) for message in messages] == found


def test_a_length_that_is_none_is_refused() -> None:
    """
    At once, not when so much has come.
    """
    reader = MessageBuffer()
    reader.feed(struct.pack(">I", MOST_BYTES + 1))

    with pytest.raises(PasserError, match="at most 1,048,576 bytes, one of 1,048,577 comes"):
        next(iter(reader))


def _connect(passer: Passer, name: str) -> PasserClient:
    return PasserClient.connect("127.0.0.1", passer.port, name, timeout_s=DEADLINE_S)


def test_messages_go_from_one_to_another() -> None:
    """
    To one, to all others, to nobody: then the passer says so.
    """
    said = Expression(Symbol("REASON"), ('a "b"\n', 0.1))
    with Passer() as passer, _connect(passer, "SEMMAP") as semmap, _connect(passer, "K1") as kernel:
        semmap.send("K1", said)
        kernel.send_to_all(HELLO)
        semmap.send("k1", said)

        assert Message("SEMMAP", '(REASON "a \\"b\\"\\n" 0.1)') == kernel.receive(DEADLINE_S)
        got = {semmap.receive(DEADLINE_S), semmap.receive(DEADLINE_S)}
        assert {Message("K1", "(HELLO)"), Message("mp-oprs", "(unknown k1)")} == got
        assert semmap.receive(0.0) is None
        assert semmap.receive(0.01) is None
        assert semmap.fileno() > 0


def test_a_name_is_to_be_had_once() -> None:
    """
    It is free again when its client hangs up.
    """
    with Passer() as passer:
        first = _connect(passer, "SEMMAP")
        with pytest.raises(PasserError, match=r"the name SEMMAP is taken \(answer 1\)"):
            _connect(passer, "SEMMAP")
        first.close()
        wait_until(lambda: "SEMMAP" not in passer.clients, "the passer to notice")
        _connect(passer, "SEMMAP").close()


def test_a_passer_that_is_not_there_goes_or_is_none() -> None:
    """
    Each an error with its address.
    """
    with Passer() as passer:
        client = _connect(passer, "SEMMAP")
        where = f"message passer 127.0.0.1:{passer.port}"
    with pytest.raises(PasserError, match=f"{where}: has gone"):
        client.receive(DEADLINE_S)
    with pytest.raises(PasserError, match=where):
        _send_often(client)
    client.close()
    with pytest.raises(PasserError, match=f"{where}: .*refused"):
        _connect(passer, "SEMMAP")
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        with pytest.raises(PasserError, match="timed out"):
            PasserClient.connect("127.0.0.1", port, "SEMMAP", timeout_s=0.1)


def _send_often(client: PasserClient) -> None:
    for _ in range(100):
        client.send("K1", HELLO)


def test_what_cannot_be_written_is_not_sent() -> None:
    """
    Not even a part of it: the passer would wait for the rest.
    """
    with Passer() as passer, _connect(passer, "SEMMAP") as semmap, _connect(passer, "K1") as kernel:
        with pytest.raises(ExpressionError):
            semmap.send("K1", Expression(Symbol("FACT"), (Symbol("a|b"),)))
        semmap.send("K1", HELLO)

        assert Message("SEMMAP", "(HELLO)") == kernel.receive(DEADLINE_S)


ECHO = """(
(defop SEND :invocation (! (SEND-MESSAGE $TO $M)) :action (SEND-MESSAGE $TO $M))
(defop ECHO :invocation (ECHO $N $X) :body ((! (SEND-MESSAGE PY (ECHOED $N $X)))))
(defop SAME :invocation (SAME $N $X $Y)
  :body ((IF (? (= $X $Y)) (! (SEND-MESSAGE PY (ECHOED $N T)))
          ELSE (! (SEND-MESSAGE PY (ECHOED $N $X))))))
)
"""


@pytest.mark.slow
def test_through_the_real_passer_and_a_real_kernel(workshop: Workshop) -> None:
    """
    Texts, names, integers and lists come back as they went; floats are compared in the kernel,
    which writes no more than six digits of them. No word of them is run, and the kernel lives.
    """
    try:
        network = NetworkNamespace.open()
    except NoNamespaceError as error:
        pytest.skip(str(error))
    workshop.stack.callback(network.close)
    passer = workshop.oprs.program.with_name("mp-oprs")
    if not passer.is_file():
        pytest.skip(f"no {passer}")
    plans = workshop.folder / "echo.opf"
    plans.write_text(ECHO, encoding="utf-8")
    workshop.run(network.inside([str(passer), "-j", "3300"])).wait_for("Message passer running")
    kernel = workshop.run(network.inside(list(map(str, [
        workshop.oprs.program, "-a", "-q", "-l", "none", "-m", "127.0.0.1", "-j", "3300",
        "-n", "K1", "-c", f'load opf "{plans}"',
    ]))))  # fmt: skip
    kernel.wait_for("Loading/Compiling OP File done")

    program = Path(__file__).parent / "echo_client.py"
    done = workshop.run(network.inside([sys.executable, str(program), "300"]))
    done.wait_for("^{.*}$")

    assert {"lost": [], "wrong": []} == json.loads(done.output)
    assert not kernel.is_over
