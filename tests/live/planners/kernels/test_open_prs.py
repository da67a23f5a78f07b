"""Real kernels at a real message passer; skipped where SEMMAP_OPRS names none."""

from __future__ import annotations

import itertools
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from doc_pages import ROOT
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.live.planners.kernels.message_passer import message
from semmap_log.live.planners.kernels.s_expressions import sendable, write_expression
from semmap_log.live.planners.question_lines import Atom
from tests.live.planners.kernels.kernel_world import make_log, serving_kernels
from tests.live.planners.kernels.open_prs import OpenPrs, PasserClient, open_prs
from tests.live.ros.running import Running, wait_until

pytestmark = pytest.mark.slow

PAGE = ROOT / "docs" / "guides" / "planners_passer.md"


@pytest.fixture
def oprs(tmp_path: Path) -> Iterator[OpenPrs]:
    with open_prs(tmp_path) as oprs:
        yield oprs


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return make_log(tmp_path / "log")


def test_facts_arrive_and_stay_right(oprs: OpenPrs, path: Path) -> None:
    """All when the kernel is there, then each change: in its database is what the map has."""
    oprs.passer()
    py = oprs.client()
    oprs.kernel("K1")
    with serving_kernels(path, oprs.port, "K1") as world:
        py.wait_for("K1", "(SHOW DOOR_FACTS SEMMAP)", "(HAS SEMMAP 3)")
        assert py.ask("K1", "(SHOW DOOR_STATE DOOR_1)") == "(HAS DOOR_1 OPEN)"
        assert py.ask("K1", "(SHOW DOOR_STATE DOOR_3)") == "(HAS DOOR_3 UNKNOWN)"
        assert py.ask("K1", "(SHOW DOOR_PROBABILITY DOOR_1)") == "(HAS DOOR_1 0.750000)"
        assert py.ask("K1", "(SHOW DOOR_PROBABILITY DOOR_2)") == "(HAS_NOT DOOR_2)"
        assert py.ask("K1", "(SHOW DOOR_NAME DOOR_2)") == r'(HAS DOOR_2 "b \"c\"")'
        for number in range(101):
            world.log.observe(1, "open" if number % 2 else "closed")
            world.changed()
        world.log.remove_door(3)
        world.changed()

        py.wait_for("K1", "(SHOW DOOR_STATE DOOR_3)", "(HAS DOOR_3 REMOVED)")
        assert py.ask("K1", "(SHOW DOOR_STATE DOOR_1)") == "(HAS DOOR_1 CLOSED)"


def test_two_kernels_ask_at_once(oprs: OpenPrs, path: Path) -> None:
    """Each gets its own answers, and an action of the one is a fact in the other."""
    oprs.passer()
    py = oprs.client()
    kernels = [oprs.kernel(name) for name in ("K1", "K2")]
    with serving_kernels(path, oprs.port, "K1", "K2"):
        for name in ("K1", "K2"):
            py.wait_for(name, "(SHOW DOOR_FACTS SEMMAP)", "(HAS SEMMAP 3)")
        for number in range(20):
            py.send("K1", f"(LET_ASK a{number} (PROBABILITY_DOOR_OPEN DOOR_1))")
            py.send("K2", f"(LET_ASK b{number} (GET_CLOSED_DOOR))")
        got: list[tuple[str, str]] = []
        while len(got) < 40:
            got += [each for each in [py.receive()] if not each[1].startswith("(SAW")]
        expected = [("K1", f"(GOT a{n} 0.750000)") for n in range(20)]
        expected += [("K2", f"(GOT b{n} DOOR_2)") for n in range(20)]
        assert sorted(expected) == sorted(got)

        assert py.ask("K1", "(LET_ASK c (SET_DOOR_OPEN DOOR_3))") == "(GOT c T)"
        py.wait_for("K2", "(SHOW DOOR_STATE DOOR_3)", "(HAS DOOR_3 OPEN)")
        assert py.ask("K2", "(LET_ASK d (SET_DOOR_OPEN DOOR_9))") == "(GOT d NIL)"
        answer = py.ask("K2", "(LET_ASK e (DOR_OPEN DOOR_9))")
        assert answer.startswith("(GOT e (ERROR \"'DOR_OPEN' is no question. Did you mean DOOR_")
    assert not any(kernel.is_over for kernel in kernels)


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("(DOOR_STATE_KNOWN DOOR_3)", "NIL"),
        ("(DOOR_OPEN DOOR_1)", "T"),
        ("(DOOR_CLOSED DOOR_1)", "NIL"),
        ("(PROBABILITY_DOOR_OPEN DOOR_1)", "0.750000"),
        ("(PROBABILITY_DOOR_CLOSED DOOR_1)", "NIL"),
        ("(GET_OPEN_DOOR $X)", "DOOR_1"),
        ("(GET_CLOSED_DOOR)", "DOOR_2"),
        ("(SET_DOOR_OPEN DOOR_2)", "T"),
        ("(SET_DOOR_CLOSED DOOR_1)", "T"),
        ("(SET_OPEN_PROBABILITY DOOR_1 0.5)", "T"),
        ("(SET_CLOSED_PROBABILITY DOOR_1 2.5)", "NIL"),
        ("(REMOVE_DOOR DOOR_1)", "T"),
        ("(DOORS)", "(. DOOR_1 DOOR_2 DOOR_3 .)"),
        ("(WAIT_UNTIL DOOR_1 CLOSED 0.1)", "NIL"),
    ],
)
def test_the_thesiss_questions_from_a_plan(question: str, answer: str, asked: PasserClient) -> None:
    """All twelve, and some of ours."""
    assert asked.ask("K1", f"(LET_ASK 1 {question})") == f"(GOT 1 {answer})"


@pytest.fixture
def asked(oprs: OpenPrs, path: Path) -> Iterator[PasserClient]:
    oprs.passer()
    py = oprs.client()
    with serving_kernels(path, oprs.port, "K1") as world:
        wait_until(lambda: any("registered" in text for text in world.said), "us to register")
        oprs.kernel("K1")
        yield py


def test_the_passer_is_killed(oprs: OpenPrs, path: Path) -> None:
    """
    Its kernels end; with the next one and its kernels all goes on, on the facts as they are then.
    """
    passer = oprs.passer()
    py = oprs.client()
    kernel = oprs.kernel("K1")
    with serving_kernels(path, oprs.port, "K1") as world:
        py.wait_for("K1", "(SHOW DOOR_FACTS SEMMAP)", "(HAS SEMMAP 3)")
        passer.kill()
        kernel.wait()
        py.close()
        world.log.observe(1, "closed")
        world.changed()
        oprs.passer()
        py = oprs.client()
        oprs.kernel("K1")

        py.wait_for("K1", "(SHOW DOOR_FACTS SEMMAP)", "(HAS SEMMAP 3)")
        assert py.ask("K1", "(SHOW DOOR_STATE DOOR_1)") == "(HAS DOOR_1 CLOSED)"
        assert py.ask("K1", "(LET_ASK 1 (DOOR_CLOSED DOOR_1))") == "(GOT 1 T)"


def test_a_kernel_is_killed_and_comes_back(oprs: OpenPrs, path: Path) -> None:
    """The passer and the others live on."""
    passer = oprs.passer()
    py = oprs.client()
    first = oprs.kernel("K1")
    oprs.kernel("K2")
    with serving_kernels(path, oprs.port, "K1", "K2") as world:
        for name in ("K1", "K2"):
            py.wait_for(name, "(SHOW DOOR_FACTS SEMMAP)", "(HAS SEMMAP 3)")
        first.kill()
        world.log.observe(1, "closed")
        world.changed()
        py.wait_for("K2", "(SHOW DOOR_STATE DOOR_1)", "(HAS DOOR_1 CLOSED)")
        oprs.kernel("K1")
        py.wait_for("K1", "(SHOW DOOR_FACTS SEMMAP)", "(HAS SEMMAP 3)")
        assert py.ask("K1", "(SHOW DOOR_STATE DOOR_1)") == "(HAS DOOR_1 CLOSED)"
    assert not passer.is_over


def test_what_is_too_much_for_a_passer_is_not_sent(oprs: OpenPrs) -> None:
    """It dies of a name that is longer than its buffer."""
    passer = oprs.passer()
    py = oprs.client()
    frame = message(["K" * 64], (Atom("A"),))

    py._client.connection.sendall(frame)
    assert py.receive() == ("mp-oprs", f"(unknown {'K' * 64})\n")
    py._client.connection.sendall(message(["K" * 64, "L" * 64], (Atom("A"),)))
    assert py.receive()[1] == f"(unknown {'K' * 64})\n"
    assert py.receive()[1] == f"(unknown {'L' * 64})\n"
    assert not passer.is_over


NASTY = [
    "a\\", "\\", '"', '\\"', '") \n quit\n(', ")\nquit\n", "\nquit\n", "\r\nquit\r\n", "a\x00b",
    "(/ 1 0)", "$X", ";", "|", "||", "~", "&", "[", "(.", ".)", "\x1b[2J", "%s%n%d", "\u200f",
    "\u2028quit\u2028", "\ud800", "\x85", "ü", "😀", "x" * 5000, "\\" * 5000, '"' * 4096, "T",
    "NIL", "quit", "x\ty", "", " ", "\x7f", "\x04", "\x1a",
]  # fmt: skip
WORDS = st.text(max_size=30) | st.text('\\"\n() aquit;|$~&.\x00\r', max_size=20)


def test_nasty_words_arrive_and_the_kernel_lives(tmp_path_factory: pytest.TempPathFactory) -> None:
    """As texts, two in a message: it has each as it was sent, and neither runs as a command."""
    with open_prs(tmp_path_factory.mktemp("nasty")) as oprs:
        oprs.passer()
        py = oprs.client()
        kernel = oprs.kernel("K1")
        ids = itertools.count()

        def arrive(words: str) -> None:
            number = next(ids)
            texts = [sendable(words), sendable(f"{words}\\")]
            sent = write_expression((Atom("ANSWER"), number, texts))
            py.send("K1", sent)
            got = py.ask("K1", f"(SHOW ANSWER {number})")
            in_text = got.replace("\n", "\\n").replace("\t", "\\t")  # it prints these raw
            assert in_text == sent.replace("ANSWER", "HAS")

        for words in NASTY:
            arrive(words)
        settings(deadline=None, suppress_health_check=list(HealthCheck))(given(WORDS)(arrive))()
        assert not kernel.is_over


def _blocks() -> list[str]:
    text = PAGE.read_text(encoding="utf-8")
    return re.findall(r"^```\w*\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def test_the_guide_from_nothing_to_the_first_answer(
    oprs: OpenPrs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its files and its commands as they stand, but for the port."""
    commands, plans, include, start, *_ = _blocks()
    (tmp_path / "doors.opf").write_text(plans)
    (tmp_path / "doors.inc").write_text(include)
    serve = start.splitlines()[1].replace("3300", str(oprs.port)).removesuffix(" &").split()
    assert start.splitlines()[0] == "mp-oprs -j 3300 &"
    assert start.splitlines()[2] == (
        "oprs -a -q -l none -m 127.0.0.1 -j 3300 -n K1 -x doors.inc < /dev/null"
    )
    monkeypatch.chdir(tmp_path)
    for line in commands.splitlines():
        _semmap_log(tmp_path, line.split()[1:]).finish()
    oprs.passer()
    with _semmap_log(tmp_path, serve[1:]) as server:
        server.wait_for("registered at the message passer")
        kernel = oprs.kernel("K1", "doors.inc", folder=tmp_path)
        kernel.wait_for("it is closed, and the log has it")
        kernel.wait_for(r"\(ANSWER K1-first DOOR_1\)")
        server.stop()

    entry = list(sl.read("office").history(1))[-1]
    assert (entry.actor, entry.source) == ("planner", "SET_DOOR_CLOSED from kernel K1")


def _semmap_log(folder: Path, words: list[str]) -> Running:
    out = folder / f"semmap-{len(list(folder.iterdir()))}"
    out.mkdir()
    with (out / "stdout").open("wb") as stdout, (out / "stderr").open("wb") as stderr:
        process = subprocess.Popen(
            [sys.executable, "-m", "semmap_log", *words], stdin=subprocess.DEVNULL, stdout=stdout,
            stderr=stderr, cwd=folder,
        )  # fmt: skip
    return Running(process, " ".join(words), out)
