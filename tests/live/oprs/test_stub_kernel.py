"""What the module declares, asks and gives back, in a stub of a kernel."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.live.oprs.building import MODULE, build_stub, compiler
from tests.live.oprs.conftest import StartServer, StartStub
from tests.live.oprs.line_server import LineServer
from tests.live.oprs.stub_process import StubKernel

THESIS = {
    "predicate": {"DOOR_STATE_KNOWN", "DOOR_OPEN", "DOOR_CLOSED"},
    "function": {
        "PROBABILITY_DOOR_OPEN", "PROBABILITY_DOOR_CLOSED", "GET_OPEN_DOOR", "GET_CLOSED_DOOR",
    },
    "action": {
        "SET_DOOR_OPEN", "SET_DOOR_CLOSED", "REMOVE_DOOR",
        "SET_OPEN_PROBABILITY", "SET_CLOSED_PROBABILITY",
    },
}  # fmt: skip
"""Section 4.4.7."""
OURS = {
    "predicate": {"ANY_OPEN_DOOR", "ANY_CLOSED_DOOR", "DOOR_MAP_LOADED", "DOOR_MAP_ANSWERS"},
    "function": {
        "DOOR_STATE", "BELIEVED", "BEST_TIME", "NEXT_DOOR", "WHY", "DOORS",
        "ASK_DOOR_MAP", "DOOR_MAP_PROBLEM",
    },
    "action": {"CONNECT_DOOR_MAP"},
}  # fmt: skip


def test_the_twelve_of_the_thesis_are_declared_and_ours(start_stub: StartStub) -> None:
    """As what the thesis has them: predicates, functions and actions."""
    declared: dict[str, set[str]] = {}

    for row in start_stub(None).call("NAMES").strip(";").split(";"):
        kind, name, _arity = row.split(" ")
        declared.setdefault(kind, set()).add(name)

    assert {kind: THESIS[kind] | OURS[kind] for kind in THESIS} == declared


@pytest.mark.parametrize(
    ("call", "question", "answer", "value"),
    [
        ("DOOR_OPEN DOOR_3", b"DOOR_OPEN DOOR_3", b"T", "TRUE"),
        ("DOOR_CLOSED DOOR_3", b"DOOR_CLOSED DOOR_3", b"NIL", "FALSE"),
        ('DOOR_OPEN DOOR_3 "14:02"', b'DOOR_OPEN DOOR_3 "14:02"', b"T", "TRUE"),
        ("DOOR_STATE_KNOWN |main door|", b'DOOR_STATE_KNOWN "main door"', b"T", "TRUE"),
        ("PROBABILITY_DOOR_OPEN DOOR_3", b"PROBABILITY_DOOR_OPEN DOOR_3", b"0.75", "0.75"),
        ("PROBABILITY_DOOR_CLOSED DOOR_3", b"PROBABILITY_DOOR_CLOSED DOOR_3", b"NIL", "NIL"),
        ("GET_OPEN_DOOR $X", b"GET_OPEN_DOOR", b"DOOR_3", "T <- DOOR_3"),
        ('GET_OPEN_DOOR $X "14:02"', b'GET_OPEN_DOOR "14:02"', b"DOOR_3", "T <- DOOR_3"),
        ("GET_CLOSED_DOOR $X", b"GET_CLOSED_DOOR", b"NIL", "NIL"),
        ("GET_OPEN_DOOR", b"GET_OPEN_DOOR", b"DOOR_3", "DOOR_3"),
        ('GET_CLOSED_DOOR "14:02"', b'GET_CLOSED_DOOR "14:02"', b"DOOR_3", "DOOR_3"),
        ("GET_OPEN_DOOR DOOR_3", b"DOOR_OPEN DOOR_3", b"T", "T"),
        ("ANY_OPEN_DOOR $X", b"GET_OPEN_DOOR", b"DOOR_3", "TRUE <- DOOR_3"),
        ("ANY_CLOSED_DOOR $X", b"GET_CLOSED_DOOR", b"NIL", "FALSE"),
        ("ANY_CLOSED_DOOR DOOR_3", b"DOOR_CLOSED DOOR_3", b"T", "TRUE"),
        ("BEST_TIME DOOR_3", b"BEST_TIME DOOR_3", b'"Mon 14:00"', '"Mon 14:00"'),
        ("NEXT_DOOR ( A B )", b"NEXT_DOOR A B", b"B", "B"),
        ("WHY D", b"WHY D", b'("a\\\\" "\\u005c" "b\\\\c")', '(. "a\\ " "\\ " "b\\c" .)'),
        ("WHY D", b"WHY D", b'"a\tb\x1b\x7f"', '"a b  "'),
        ("DOORS", b"DOORS", b'(DOOR_1 (0.5 "a)") NIL)', '(. DOOR_1 (. 0.5 "a)" .) NIL .)'),
        ("ASK_DOOR_MAP N", b"N", b"2147483647", "integer 2147483647"),
        ("ASK_DOOR_MAP N", b"N", b"-2147483648", "integer -2147483648"),
        ("ASK_DOOR_MAP N", b"N", b"2147483648", "long 2147483648"),
        ("ASK_DOOR_MAP N", b"N", b"9223372036854775808", "9.2233720368547758e+18"),
        ("ASK_DOOR_MAP N", b"N", b"1.0", "1"),
        ("ASK_DOOR_MAP NEW 0.1 -7", b"NEW 0.1 -7", b"()", "(. .)"),
        ("DOOR_MAP_ANSWERS", b"DOOR_STATE_KNOWN DOOR_0", b"NIL", "TRUE"),
    ],
)
def test_questions_and_values(
    start_stub: StartStub,
    start_server: StartServer,
    *,
    call: str,
    question: bytes,
    answer: bytes,
    value: str,
) -> None:
    """What a kernel calls, the line that is sent, the line that comes, and what the kernel gets."""
    server = start_server(lambda _line: answer + b"\n")

    stub = start_stub(server.address)
    got = stub.call(call)

    assert ([question], value) == (server.lines, got)
    stub.end()


@pytest.mark.parametrize(
    ("call", "action"),
    [
        ("SET_DOOR_OPEN DOOR_3", b"SET_DOOR_OPEN DOOR_3"),
        ("SET_DOOR_CLOSED DOOR_3", b"SET_DOOR_CLOSED DOOR_3"),
        ("REMOVE_DOOR DOOR_3", b"REMOVE_DOOR DOOR_3"),
        ("SET_OPEN_PROBABILITY DOOR_3 0.1", b"SET_OPEN_PROBABILITY DOOR_3 0.1"),
        ("SET_CLOSED_PROBABILITY DOOR_3 1", b"SET_CLOSED_PROBABILITY DOOR_3 1"),
        ("ASK_DOOR_MAP SET_DOOR_OPEN DOOR_3", b"SET_DOOR_OPEN DOOR_3"),
    ],
)
def test_actions_carry_a_command_id(
    start_stub: StartStub, start_server: StartServer, call: str, action: bytes
) -> None:
    """Each its own, however it is called; T is what the server says."""
    server = start_server(lambda line: b"T\n" if line.endswith(action) else b"NIL\n")
    stub = start_stub(server.address)

    assert ["T", "T"] == [stub.call(call), stub.call(call)]

    ids = [line.removesuffix(b" " + action) for line in server.lines]
    assert all(re.fullmatch(rb"#[0-9a-f]{32}", command) for command in ids)
    assert 2 == len(set(ids))


@pytest.mark.parametrize(
    "answer",
    [
        b"", b" ", b"T T", b"(", b")", b"(T", b"T)", b'"abc', b'"\\x"', b'"\\u12g4"', b'"\\ud800"',
        b"-", b"1-2", b"0x10", b"nan", b"inf", b"-inf", b"1e999", b"a|b", b"$X", b"a;b",
        b"(" * 1000,
        b"(" * 33 + b")" * 33, b'"a"b"', b"ERROR", b'ERROR "no such question"', b"<html>",
    ],
)  # fmt: skip
def test_what_is_no_answer_is_nil(
    start_stub: StartStub, start_server: StartServer, answer: bytes
) -> None:
    """And it is said; the next question has its own answer."""
    server = start_server(lambda line: (b"7.5" if b"BEST" in line else answer) + b"\n")
    stub = start_stub(server.address)

    assert "NIL" == stub.call("WHY DOOR_3")
    problem = stub.call("DOOR_MAP_PROBLEM")
    assert problem.startswith('"WHY DOOR_3: ')
    assert "WHY DOOR_3: " in stub.errors
    assert ["7.5", "NIL"] == [stub.call("BEST_TIME DOOR_3"), stub.call("DOOR_MAP_PROBLEM")]
    stub.end()


def test_an_error_has_no_control_characters(
    start_stub: StartStub, start_server: StartServer
) -> None:
    """It becomes a text in a kernel, and a line on a terminal."""
    server = start_server(lambda _line: b'ERROR "\x1b[2J\r(quit)\t"\n')
    stub = start_stub(server.address)

    assert "NIL" == stub.call("WHY DOOR_3")

    assert '"WHY DOOR_3: ERROR " [2J (quit) ""' == stub.call("DOOR_MAP_PROBLEM")
    assert "\x1b" not in stub.errors


@pytest.mark.parametrize(
    ("call", "value", "problem"),
    [
        ("DOOR_OPEN $X", "FALSE", "a variable in it is not bound"),
        ("WHY EXPRESSION", "NIL", "no atom, text, number or list of such"),
        ("SET_OPEN_PROBABILITY DOOR_3 nan", "NIL", "a number in it is not finite"),
        ("SET_OPEN_PROBABILITY DOOR_3 inf", "NIL", "a number in it is not finite"),
        ("WHY " + "( " * 40 + "A" + " )" * 40, "NIL", "its lists are nested too deep"),
        ("WHY x" + "61" * 65600, "NIL", "it is longer than 64 KiB"),
        ("SET_DOOR_OPEN x" + "61" * 65530, "NIL", "is longer than 64 KiB"),
        ("WHY |" + "a" * 70000 + "|", "NIL", "it is longer than 64 KiB"),
        ("ASK_DOOR_MAP", "NIL", "expected the question's first word"),
        ('ASK_DOOR_MAP "WHY"', "NIL", "expected the question's first word"),
        ("CONNECT_DOOR_MAP DOOR_3", "NIL", "expected a text such as"),
    ],
)
def test_what_is_no_question_is_not_sent(
    start_stub: StartStub, start_server: StartServer, call: str, value: str, problem: str
) -> None:
    """A kernel hands over whatever a plan has written."""
    server = start_server(lambda _line: b"T\n")
    stub = start_stub(server.address)

    assert value == stub.call(call)

    assert problem in stub.call("DOOR_MAP_PROBLEM")
    assert [] == server.lines


@pytest.mark.parametrize(
    ("number", "sent"),
    [
        ("0.1", b"0.1"),
        ("0.30000000000000004", b"0.30000000000000004"),
        ("1e-7", b"1e-07"),
        ("5e-324", b"4.94065645841247e-324"),
        ("1.7976931348623157e308", b"1.7976931348623157e+308"),
        ("2147483648", b"2147483648"),
    ],
)
def test_numbers_go_and_come_to_the_last_digit(
    start_stub: StartStub, start_server: StartServer, number: str, sent: bytes
) -> None:
    """The shortest text that is the same number."""
    server = start_server(lambda line: line.split(b" ")[1] + b"\n")
    stub = start_stub(server.address)

    value = stub.call(f"ASK_DOOR_MAP ECHO {number}")

    assert [b"ECHO " + sent] == server.lines
    assert float(number) == float(value.rpartition(" ")[2]) == float(sent)


def test_a_decimal_comma_changes_nothing(
    start_stub: StartStub, start_server: StartServer, tmp_path: Path
) -> None:
    """In a kernel that took its user's locale."""
    if shutil.which("localedef") is None:
        pytest.skip("no localedef here")
    command = ["localedef", "-i", "de_DE", "-f", "UTF-8", tmp_path / "de_DE.UTF-8"]
    if subprocess.run(command, capture_output=True, check=False).returncode not in {0, 1}:
        pytest.skip("localedef cannot make the locale de_DE here")
    server = start_server(lambda _line: b"0.25\n")
    stub = start_stub(server.address, {"LOCPATH": str(tmp_path), "LC_ALL": "de_DE.UTF-8"})

    value = stub.call("ASK_DOOR_MAP ECHO 0,75")

    assert "0,25" == value  # printed by the stub
    assert [b"ECHO 0.75"] == server.lines


@pytest.fixture(scope="module")
def echo(
    stub_program: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[StubKernel, LineServer]]:
    """A stub and a server that answers with the question's last word."""
    folder = tmp_path_factory.mktemp("echo")
    with (
        LineServer(lambda line: line.partition(b" ")[2] + b"\n", folder / "doors") as server,
        StubKernel([stub_program], folder / "stub.err", address=server.address) as stub,
    ):
        yield stub, server


def _in_a_kernel(text: str) -> str:
    """Return what a text is in a kernel."""
    blank = re.sub(r"[\x00-\x1f\x7f]", " ", text)
    return f"{blank} " if blank.endswith("\\") else blank


TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=80)


@given(text=TEXTS)
def test_any_text_goes_as_one_word_and_comes_back(
    echo: tuple[StubKernel, LineServer], text: str
) -> None:
    """Quotes, backslashes, line ends: one line, JSON."""
    stub, server = echo

    value = stub.call(f"ASK_DOOR_MAP ECHO x{text.encode().hex()}")

    assert text == json.loads(server.lines[-1].removeprefix(b"ECHO "))
    assert _in_a_kernel(text) == value[1:-1]


@given(text=st.text(st.characters(exclude_categories=["Cs"]), max_size=80), is_ascii=st.booleans())
def test_texts_of_an_answer(
    stub_program: Path, echo: tuple[StubKernel, LineServer], text: str, is_ascii: bool
) -> None:
    """As Python's json writes them, both ways, NUL too."""
    stub, server = echo
    before = server.answer
    server.answer = lambda _line: json.dumps(text, ensure_ascii=is_ascii).encode() + b"\n"

    value = stub.call("WHY DOOR_3")

    server.answer = before
    assert _in_a_kernel(text) == value[1:-1]


@given(answer=st.binary(max_size=60).map(lambda some: some.replace(b"\n", b"")))
def test_no_bytes_whatever_break_the_module(
    echo: tuple[StubKernel, LineServer], answer: bytes
) -> None:
    """Any line for an answer; the next question has its own."""
    stub, server = echo
    before = server.answer
    server.answer = lambda _line: answer + b"\n"
    stub.call("WHY DOOR_3")
    server.answer = before

    assert '"still there"' == stub.call('ASK_DOOR_MAP ECHO "still there"')


@pytest.mark.slow
def test_valgrind_finds_nothing(tmp_path: Path, start_server: StartServer) -> None:
    """Values, lists, refusals, a server that hangs up."""
    if compiler() is None or shutil.which("valgrind") is None:
        pytest.skip("no C compiler or no valgrind here")
    program = build_stub(tmp_path)
    answers = [b'(DOOR_1 (0.5 "a"))\n', b"NIL\n", b"(((\n", (b"T",), b"DOOR_1\n", b"a\0b\n"]
    server = start_server(lambda line: answers[len(server.lines) % len(answers)])
    command = ["valgrind", "-q", "--error-exitcode=9", "--leak-check=full", program]

    with StubKernel(command, tmp_path / "errors", address=server.address) as stub:
        for _ in range(3):
            for line in ("DOORS", 'WHY "a b"', "SET_DOOR_OPEN DOOR_1", "ANY_OPEN_DOOR $X"):
                stub.call(line)
            stub.call("GET_OPEN_DOOR $X")

    assert "ERROR SUMMARY" not in stub.errors


def test_the_module_uses_no_header_but_those_that_are_stubbed() -> None:
    """What it needs of OpenPRS is in the stub; else CI could not compile it."""
    kernel = (MODULE / "kernel.h").read_text(encoding="utf-8")
    used = set(re.findall(r'#include "(.+)"', kernel))

    stubbed = {path.name for path in (Path(__file__).parent / "stub").glob("*-pub.h")}

    assert stubbed == used
