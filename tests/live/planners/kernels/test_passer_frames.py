"""Frames of the message passer, byte by byte."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.errors import ExpressionError, PasserError
from semmap_log.live.planners.kernels.message_passer import (
    MOST_MESSAGE_BYTES,
    MessageReader,
    goodbye,
    message,
    registration,
    unknown_name,
)
from semmap_log.live.planners.question_lines import Atom

FACT = (Atom("F"), Atom("ü"))


def test_frames_are_those_of_the_protocol() -> None:
    """Integers of four bytes, big-endian; lengths in bytes."""
    zero = b"\x00\x00\x00"

    assert zero + b"\x01" + zero + b"\x06SEMMAP" == registration("SEMMAP")
    assert zero + b"\x01" + zero + b"\x02K1" + zero + b"\x06(F \xc3\xbc)" == message(["K1"], FACT)
    assert (
        zero + b"\x03" + zero + b"\x02" + zero + b"\x06(F \xc3\xbc)"
        + zero + b"\x02K1" + zero + b"\x03K22" == message(["K1", "K22"], FACT)
    )  # fmt: skip
    assert zero + b"\x04" == goodbye()


def parts_of(frame: bytes) -> tuple[list[str], str]:
    """Return the recipients and the text of a message that is sent."""
    at = 0

    def number() -> int:
        nonlocal at
        at += 4
        return int.from_bytes(frame[at - 4 : at], "big")

    def text() -> str:
        nonlocal at
        length = number()
        at += length
        return frame[at - length : at].decode()

    if number() == 1:
        return [text()], text()
    count, what = number(), text()
    return [text() for _ in range(count)], what


MESSAGES = st.lists(st.tuples(st.binary(max_size=20), st.binary(max_size=300)), max_size=8)


@given(MESSAGES, st.data())
def test_messages_are_taken_in_whatever_pieces(
    messages: list[tuple[bytes, bytes]], data: st.DataObject
) -> None:
    """None is given before it is whole, none twice."""
    wire = b"\x00\x00\x00\x00" + b"".join(
        len(part).to_bytes(4, "big") + part for each in messages for part in each
    )
    cuts = sorted(data.draw(st.lists(st.integers(0, len(wire)), max_size=10)))
    received, found, answer = MessageReader(), [], None
    for start, end in zip([0, *cuts], [*cuts, len(wire)], strict=True):
        received.take(wire[start:end])
        if answer is None:
            answer = received.registered()
        if answer is not None:
            found += received.messages()

    assert answer == 0
    assert messages == found


@pytest.mark.parametrize("length", [b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff", b"GET "])
def test_what_is_no_passer_is_found_out(length: bytes) -> None:
    """Not by waiting for two gigabytes."""
    received = MessageReader()
    received.take(length)

    with pytest.raises(PasserError, match="this is no message passer"):
        received.messages()


@pytest.mark.parametrize(
    "name",
    ["", "kill-mp", "mp-oprs", "ope", "oprs-server", "A B", "1A", "A\n", "A)", "K" * 65, "do"],
)
def test_names_that_harm_are_not_ours(name: str) -> None:
    """`kill-mp` ends the passer; what is no atom ends what kernels read."""
    with pytest.raises(PasserError, match="cannot be a name at the message passer"):
        registration(name)


@pytest.mark.parametrize("name", ["", "K" * 65, "ü" * 33, "A\x00", "A\n", "\ud800"])
def test_nothing_is_sent_to_names_that_harm(name: str) -> None:
    """The passer itself dies of a recipient whose name is longer than its buffer."""
    with pytest.raises(PasserError, match="nothing is sent to"):
        message(["K1", name], FACT)


def test_a_message_has_an_end() -> None:
    """One of some megabytes keeps a kernel busy for minutes."""
    with pytest.raises(ExpressionError, match="expected at most 1,048,576 bytes"):
        message(["K1"], (Atom("A"), *[12345] * (MOST_MESSAGE_BYTES // 5)))


@pytest.mark.parametrize(
    ("text", "name"),
    [
        (b"(unknown K1)\n", "K1"),
        (b"(unknown a b)", "a b"),
        (b"(unknown \xff)\n", "\ufffd"),
        (b"(disconnected K1)\n", None),
        (b"", None),
    ],
)
def test_whom_the_passer_does_not_know(text: bytes, name: str | None) -> None:
    """Names are those of other people."""
    assert name == unknown_name(text)
