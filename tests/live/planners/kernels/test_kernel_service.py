"""Kernels at a message passer: told of the doors, and answered."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.errors import PasserError
from semmap_log.live.planners.addresses import TcpAddress
from semmap_log.live.planners.asked import AskedQuestion
from semmap_log.live.planners.door_view import DoorView
from semmap_log.live.planners.kernels import kernel_questions, kernel_service
from semmap_log.live.planners.kernels.kernel_service import (
    MOST_WAITING_BYTES,
    Kernels,
    KernelSession,
    Patience,
)
from semmap_log.live.planners.kernels.message_passer import PasserConnection
from semmap_log.live.planners.question_lines import Answer, Atom
from tests.live.planners.kernels.kernel_world import KernelWorld, make_log, serving_kernels
from tests.live.planners.kernels.stub_passer import StubKernel, StubPasser
from tests.live.ros.running import wait_until

ALL = [
    "(DOOR_STATE DOOR_1 OPEN)",
    "(DOOR_PROBABILITY DOOR_1 0.75)",
    '(DOOR_NAME DOOR_1 "main")',
    "(DOOR_STATE DOOR_2 CLOSED)",
    r'(DOOR_NAME DOOR_2 "b \"c\"")',
    "(DOOR_STATE DOOR_3 UNKNOWN)",
    "(DOOR_FACTS SEMMAP 3)",
]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return make_log(tmp_path / "log")


@pytest.fixture
def passer() -> Iterator[StubPasser]:
    with StubPasser() as passer:
        yield passer


@pytest.fixture
def world(path: Path, passer: StubPasser) -> Iterator[KernelWorld]:
    with serving_kernels(path, passer.port, "K1") as world:
        passer.wait_until_there("SEMMAP")
        yield world


@pytest.fixture
def kernel(passer: StubPasser) -> Iterator[StubKernel]:
    with passer.kernel("K1") as kernel:
        yield kernel


def _facts(passer: StubPasser, kernel: str = "K1") -> list[str]:
    return [text for text in passer.texts(kernel) if not text.startswith("(ANSWER")]


def test_a_kernel_that_is_there_is_told_all(
    kernel: StubKernel, passer: StubPasser, world: KernelWorld
) -> None:
    """First that we are there, by which it is seen to be there, too."""
    passer.wait_for("K1", ALL[-1])

    assert ["(DOOR_MAP SEMMAP)", *ALL] == _facts(passer)


def test_a_kernel_that_comes_later_is_told_all(passer: StubPasser, world: KernelWorld) -> None:
    """And not before: the passer would complain of each fact."""
    wait_until(lambda: len(passer.texts("K1")) > 1, "some calls")
    assert {"(DOOR_MAP SEMMAP)"} == set(passer.texts("K1"))

    with passer.kernel("K1"):
        passer.wait_for("K1", ALL[-1])
        assert ALL == _facts(passer)[-len(ALL) :]


def test_each_change_is_told(kernel: StubKernel, passer: StubPasser, world: KernelWorld) -> None:
    passer.wait_for("K1", ALL[-1])
    before = len(_facts(passer))

    world.log.observe(1, "closed")
    world.changed()
    passer.wait_for("K1", "(DOOR_STATE DOOR_1 CLOSED)")
    world.log.update_door(2, prob_open=0.1 + 0.2)
    world.changed()
    passer.wait_for("K1", "(DOOR_PROBABILITY DOOR_2 0.30000000000000004)")
    door = world.log.add_door(x=0.0, y=0.0, theta=0.0, width=1.0, state="moving")
    world.changed()
    passer.wait_for("K1", f"(DOOR_STATE DOOR_{door} MOVING)")
    world.log.annotate(door, "name", "new\\")
    world.changed()
    passer.wait_for("K1", f'(DOOR_NAME DOOR_{door} "new\\\\ ")')
    world.log.remove_door(1)
    world.changed()
    passer.wait_for("K1", "(DOOR_STATE DOOR_1 REMOVED)")
    passer.wait_for("K1", "(DOOR_PROBABILITY DOOR_1 NIL)")
    passer.wait_for("K1", "(DOOR_NAME DOOR_1 NIL)")

    assert len(_facts(passer)) == before + 7


def test_several_kernels_are_told(path: Path, passer: StubPasser) -> None:
    """Each change goes to all of them as one message."""
    with (
        passer.kernel("K1"),
        passer.kernel("K2"),
        serving_kernels(path, passer.port, "K1", "K2") as world,
    ):
        for name in ("K1", "K2"):
            passer.wait_for(name, ALL[-1])
        world.log.observe(1, "closed")
        world.changed()

        for name in ("K1", "K2"):
            passer.wait_for(name, "(DOOR_STATE DOOR_1 CLOSED)")


@pytest.mark.slow
def test_a_kernel_that_went_is_called_until_it_is_back(
    passer: StubPasser, world: KernelWorld
) -> None:
    """It is told all again: it may be a new one."""
    with passer.kernel("K1"):
        passer.wait_for("K1", ALL[-1])
    passer.messages.clear()
    world.log.observe(1, "closed")
    world.changed()
    passer.wait_for("K1", "(DOOR_STATE DOOR_1 CLOSED)")

    with passer.kernel("K1"):
        passer.wait_for("K1", ALL[-1])
        assert "(DOOR_STATE DOOR_2 CLOSED)" in passer.texts("K1")


@pytest.mark.parametrize("name", ["K1", "another"])
def test_who_asks_for_the_facts_gets_them(
    name: str, passer: StubPasser, world: KernelWorld
) -> None:
    """Whether it is one of those that are told of changes, or not."""
    with passer.kernel(name) as kernel:
        if name == "K1":
            passer.wait_for("K1", ALL[-1])
        passer.messages.clear()
        kernel.send("(FACTS)")
        passer.wait_for(name, ALL[-1])

        assert ALL == _facts(passer, name)


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("(DOOR_OPEN DOOR_1)", "T"),
        ("(DOOR_OPEN DOOR_2)", "NIL"),
        ("(DOOR_OPEN DOOR_9)", "NIL"),
        ("DOOR_OPEN DOOR_1", "T"),
        ("(DOOR_OPEN DOOR_main)", "T"),
        ('(DOOR_OPEN "main")', "T"),
        ("(PROBABILITY_DOOR_OPEN DOOR_1)", "0.75"),
        ("(GET_OPEN_DOOR)", "DOOR_1"),
        ("(GET_OPEN_DOOR $X)", "DOOR_1"),
        ("(GET_CLOSED_DOOR @X)", "DOOR_2"),
        ("(DOORS)", "(. DOOR_1 DOOR_2 DOOR_3 .)"),
        ("(DOORS MOVING)", "(. .)"),
        ("(DOOR_STATE DOOR_1)", "OPEN"),
        ('(BELIEVED (DOOR_STATE DOOR_2) AT "event:2")', "CLOSED"),
        ('(BELIEVED (DOOR_OPEN DOOR_1) AT "event:0")', "T"),
        ("(NEXT_DOOR (. DOOR_1 DOOR_9 .))", "DOOR_1"),
        ("(WAIT_UNTIL DOOR_1 OPEN 60)", "T"),
        ("(WAIT_UNTIL DOOR_1 CLOSED 0)", "NIL"),
        ("(SET_DOOR_OPEN DOOR_3)", "T"),
        ("(SET_DOOR_OPEN DOOR_9)", "NIL"),
        ("(SET_OPEN_PROBABILITY DOOR_3 0.5)", "T"),
        ("(SET_OPEN_PROBABILITY DOOR_3 1.5)", "NIL"),
        ("(REMOVE_DOOR DOOR_3)", "T"),
        ("", '(ERROR "expected a question such as DOOR_OPEN DOOR [TIME], got none")'),
        ("(DOOR_OPEN $X)", '(ERROR "expected a value, got the variable $X, which has none")'),
        ("(DOOR_OPEN)", '(ERROR "DOOR_OPEN DOOR [TIME]: expected DOOR, got nothing more")'),
    ],
)
def test_questions_are_answered(
    question: str, answer: str, kernel: StubKernel, world: KernelWorld
) -> None:
    """As over the socket, in the form of kernels."""
    assert answer == kernel.answer(f"(ASK 17 {question})", "17")


@pytest.mark.parametrize("ask_id", ["17", "-3", "K1.17", "q", '"a \\"b\\""', "5000000000ll"])
def test_answers_bear_the_id_of_their_question(
    ask_id: str, kernel: StubKernel, world: KernelWorld
) -> None:
    """An atom, a number or a text."""
    assert kernel.answer(f"(ASK {ask_id} (DOOR_OPEN DOOR_1))", ask_id) == "T"


@pytest.mark.parametrize(
    "text",
    [
        "(ASK)", "(ASK (a) (DOORS))", "(ASK 1.5 (DOORS))", "(ASK $X (DOORS))", "(ASK a;b (DOORS))",
        "(ASK (. a .) (DOORS))", "(HELLO)", "(FACTS 1)", "hello", "", "(", "\x00", "(A \udcff)",
        "(SEMMAP_ECHO 1)", "(ASK 1 (/ 1 0)) (DOORS)", "x" * 100_000, "(" * 10_000,
    ],
)  # fmt: skip
def test_messages_that_nobody_understands_are_told(
    text: str, kernel: StubKernel, world: KernelWorld
) -> None:
    """And the service goes on."""
    if text:
        kernel.send(text)
        wait_until(lambda: any("'K1' sent" in said for said in world.said), lambda: world.said)

    assert kernel.answer("(ASK 1 (DOOR_OPEN DOOR_1))", "1") == "T"


def test_complaints_have_an_end(kernel: StubKernel, world: KernelWorld) -> None:
    """Who floods us does not fill the disk."""
    for _ in range(100):
        kernel.send("(HELLO)")
    assert kernel.answer("(ASK 1 (DOORS))", "1")

    said = [text for text in world.said if "sent" in text]
    assert len(said) == kernel_service.MOST_COMPLAINTS
    assert world.said[-1] == "OPRS: more such messages are not told."


@given(text=st.text(max_size=30) | st.text('()"\\ ASK1.;$', max_size=30))
def test_whatever_is_asked_the_answer_is_safe(hostile: StubKernel, text: str) -> None:
    """The passer of this test takes nothing that a kernel could take amiss."""
    hostile.send(f"(ASK 1 ({text or 'x'}))")

    assert hostile.answer("(ASK 2 (DOOR_OPEN DOOR_1))", "2") == "T"


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StubKernel]:
    path = make_log(tmp_path_factory.mktemp("hostile") / "log")
    with StubPasser() as passer, serving_kernels(path, passer.port), passer.kernel("K1") as kernel:
        passer.wait_until_there("SEMMAP")
        yield kernel


def test_nobody_with_a_long_name_is_answered(passer: StubPasser, world: KernelWorld) -> None:
    """The passer would die of it, if that one had gone meanwhile."""
    with passer.kernel("K" * 90) as kernel:
        kernel.send("(ASK 1 (DOORS))")
        wait_until(lambda: any("nothing can be sent" in text for text in world.said), "complaint")

    with passer.kernel("K2") as other:
        assert other.answer("(ASK 1 (DOOR_OPEN DOOR_1))", "1") == "T"


def test_an_action_is_answered_once_it_lasts(
    kernel: StubKernel, passer: StubPasser, world: KernelWorld, path: Path
) -> None:
    """Who asked it is in the log."""
    assert kernel.answer("(ASK 1 (SET_DOOR_CLOSED DOOR_1))", "1") == "T"

    entry = list(sl.read(path).history(1))[-1]
    assert (entry.actor, entry.source) == ("planner", "SET_DOOR_CLOSED from kernel K1")
    passer.wait_for("K1", "(DOOR_STATE DOOR_1 CLOSED)")


def test_an_answer_goes_before_the_fact(
    kernel: StubKernel, passer: StubPasser, patient: KernelWorld
) -> None:
    """A real passer takes 40 ms for the second of two messages, and a plan waits for the answer."""
    passer.wait_for("K1", ALL[-1])
    for number in range(20):
        passer.messages.clear()
        state = "OPEN" if number % 2 else "CLOSED"
        kernel.answer(f"(ASK {number} (SET_DOOR_{state} DOOR_1))", str(number))
        passer.wait_for("K1", f"(DOOR_STATE DOOR_1 {state})")
        assert passer.texts("K1") == [f"(ANSWER {number} T)", f"(DOOR_STATE DOOR_1 {state})"]


def test_why_an_action_is_refused_stands_on_one_line(
    kernel: StubKernel, world: KernelWorld
) -> None:
    """Whatever door somebody names: the line is for the terminal of whoever runs the server."""
    assert kernel.answer('(ASK 1 (SET_DOOR_OPEN "a\n\x1b[2Jb"))', "1") == "NIL"

    (said,) = [text for text in world.said if "refused" in text]
    assert said.isprintable()
    assert "from kernel K1: refused: " in said


def _events(world: KernelWorld) -> int:
    return len(list(world.log.history()))


def test_an_action_that_comes_again_soon_is_done_once(
    kernel: StubKernel, passer: StubPasser, world: KernelWorld
) -> None:
    """The same kernel, ask-id and words within a minute; anything else is another action."""
    minute_ns = kernel_questions.REPEATED_WITHIN_NS
    before = _events(world)
    text = "(ASK 1 (SET_DOOR_CLOSED DOOR_1))"

    assert [kernel.answer(text, "1"), kernel.answer(text, "1")] == ["T", "T"]
    world.now_ns[0] += minute_ns - 1
    assert kernel.answer(text, "1") == "T"
    assert _events(world) == before + 1

    assert kernel.answer("(ASK 1 (SET_DOOR_OPEN DOOR_1))", "1") == "T"
    assert kernel.answer("(ASK 2 (SET_DOOR_OPEN DOOR_1))", "2") == "T"
    with passer.kernel("K2") as other:
        assert other.answer("(ASK 1 (SET_DOOR_OPEN DOOR_1))", "1") == "T"
    assert _events(world) == before + 4
    world.now_ns[0] += 2 * minute_ns
    assert kernel.answer(text, "1") == "T"
    assert _events(world) == before + 5


def test_an_action_that_comes_again_after_a_restart_is_done_once(
    kernel: StubKernel, passer: StubPasser, path: Path
) -> None:
    """What was done before the server was ended is in the log, not in its memory."""
    for _ in range(2):
        with serving_kernels(path, passer.port, "K1") as world:
            passer.wait_until_there("SEMMAP")
            assert kernel.answer("(ASK 1 (SET_DOOR_CLOSED DOOR_1))", "1") == "T"
            events = _events(world)

    assert events == 6


def test_a_kernels_questions_are_answered_in_their_order(
    kernel: StubKernel, passer: StubPasser, world: KernelWorld
) -> None:
    """What it asks behind an action sees it done."""
    for number in range(0, 60, 3):
        state = "OPEN" if number % 2 else "CLOSED"
        kernel.send(f"(ASK {number} (SET_DOOR_{state} DOOR_1))")
        kernel.send(f"(ASK {number + 1} (DOOR_{state} DOOR_1))")
    kernel.answer("(ASK end (DOORS))", "end")

    answers = [text for text in passer.texts("K1") if text.startswith("(ANSWER")]
    assert len(answers) == 41
    assert all(text.endswith(" T)") for text in answers[:-1]), answers


def test_a_question_that_waits_holds_up_nothing(kernel: StubKernel, world: KernelWorld) -> None:
    """Neither of the same kernel; and it is answered as soon as the door is so."""
    kernel.send("(ASK w (WAIT_UNTIL DOOR_1 CLOSED 3600))")
    kernel.send("(ASK v (WAIT_UNTIL DOOR_1 CLOSED 0.05))")
    assert kernel.answer("(ASK 1 (SET_DOOR_OPEN DOOR_1))", "1") == "T"
    wait_until(lambda: kernel.answers("v"), "the time to be over")
    assert kernel.answers("v") == ["NIL"]
    assert [] == kernel.answers("w")

    assert kernel.answer("(ASK 2 (SET_DOOR_CLOSED DOOR_1))", "2") == "T"
    wait_until(lambda: kernel.answers("w"), "the door to be closed")
    assert kernel.answers("w") == ["T"]


def test_waiting_questions_have_an_end(
    kernel: StubKernel, world: KernelWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who asks for more is told."""
    monkeypatch.setattr(kernel_questions, "MOST_WAITS", 3)
    for number in range(3):
        kernel.send(f"(ASK {number} (WAIT_UNTIL DOOR_1 CLOSED 3600))")

    answer = kernel.answer("(ASK 3 (WAIT_UNTIL DOOR_1 CLOSED 3600))", "3")

    assert answer == '(ERROR "3 questions wait already.")'


def test_what_was_answered_early_is_not_kept_until_its_time(
    kernel: StubKernel, world: KernelWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kernel that waits all day, again and again, fills no memory."""
    monkeypatch.setattr(kernel_service, "MOST_WAITS", 2)
    for number in range(30):
        state = "OPEN" if number % 2 else "CLOSED"
        kernel.send(f"(ASK w{number} (WAIT_UNTIL DOOR_1 {state} 86400))")
        assert kernel.answer(f"(ASK {number} (SET_DOOR_{state} DOOR_1))", str(number)) == "T"
        wait_until(lambda number=number: kernel.answers(f"w{number}"), "its answer")

    session = world.service._session
    assert session is not None
    assert 1 <= len(session._ends) <= 4 * 2 + 1


def test_the_passer_goes_and_another_comes(path: Path) -> None:
    """Kernels end with it; those that come with the next one are told all."""
    with StubPasser() as passer:
        port = passer.port
        kernel = passer.kernel("K1")
        with serving_kernels(path, port, "K1") as world:
            passer.wait_for("K1", ALL[-1])
            passer.close()
            kernel.close()
            wait_until(lambda: any("gone" in text for text in world.said), "it to be missed")
            world.log.observe(1, "closed")
            world.changed()
            with StubPasser(port) as next_one, next_one.kernel("K1") as other:
                next_one.wait_for("K1", ALL[-1])

                assert "(DOOR_STATE DOOR_1 CLOSED)" in next_one.texts("K1")
                assert "(DOOR_STATE DOOR_1 OPEN)" not in next_one.texts("K1")
                assert other.answer("(ASK 1 (DOOR_CLOSED DOOR_1))", "1") == "T"


def test_a_passer_that_is_not_there_yet_is_tried_again(path: Path) -> None:
    """And what is wrong is told once."""
    with StubPasser() as passer:
        port = passer.port
    with serving_kernels(path, port, "K1") as world:
        wait_until(lambda: world.said, "the first try")
        with StubPasser(port) as passer, passer.kernel("K1"):
            passer.wait_for("K1", ALL[-1])
        assert len([text for text in world.said if "no message passer at" in text]) == 1
        assert not [text for text in world.said if "Errno" in text]


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (1, "has another client called SEMMAP: it must leave, or --oprs-name"),
        (2, "does not let SEMMAP in: it answered 2"),
    ],
)
def test_a_passer_that_refuses_is_tried_again(answer: int, text: str, path: Path) -> None:
    """Our predecessor may be about to leave."""
    with StubPasser(answer=answer) as passer, serving_kernels(path, passer.port, "K1") as world:
        wait_until(lambda: passer.registrations > 1, "another try")
        assert any(text in said for said in world.said), world.said
        passer.answer = 0
        with passer.kernel("K1"):
            passer.wait_for("K1", ALL[-1])


@pytest.mark.slow
def test_a_passer_that_is_silent_is_left(path: Path) -> None:
    """It stands still; the log and its other readers do not."""
    patience = Patience(ask_after_s=0.05, give_up_after_s=0.5)
    with (
        StubPasser() as passer,
        passer.kernel("K1"),
        serving_kernels(path, passer.port, "K1", patience=patience) as world,
    ):
        passer.wait_for("K1", ALL[-1])
        passer.reads.clear()
        for number in range(200):
            world.log.observe(1, "open" if number % 2 else "closed")
            world.changed()
        wait_until(lambda: any("does not answer" in text for text in world.said), "its end")
        passer.reads.set()
        passer.messages.clear()
        passer.wait_for("K1", ALL[-1])


@pytest.fixture
def patient(path: Path, passer: StubPasser) -> Iterator[KernelWorld]:
    """What wakes up for nothing but what it has to do."""
    patience = Patience(ask_after_s=3600, give_up_after_s=7200)
    with serving_kernels(path, passer.port, "K1", patience=patience) as world:
        passer.wait_until_there("SEMMAP")
        yield world


def test_changes_that_a_slow_passer_has_no_time_for_become_one(
    kernel: StubKernel, passer: StubPasser, patient: KernelWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a kernel hears in the end is how the doors are."""
    world = patient
    passer.wait_for("K1", ALL[-1])
    monkeypatch.setattr(kernel_service, "MOST_WAITING_BYTES", 1)
    before = len(_facts(passer))
    with monkeypatch.context() as slow:
        slow.setattr(PasserConnection, "send", lambda _: None)
        for number in range(101):
            world.log.observe(1, "open" if number % 2 else "closed")
            world.log.update_door(1, prob_open=number / 128)
            world.changed()
            if number == 0:
                wait_until(lambda: not world.service._has_changed.is_set(), "the first to be told")
    world.service.wake()
    passer.wait_for("K1", "(DOOR_PROBABILITY DOOR_1 0.78125)")

    facts = _facts(passer)[before:]
    assert 2 <= len(facts) <= 6
    assert "(DOOR_STATE DOOR_1 CLOSED)" in facts


def test_a_passer_that_takes_nothing_is_waited_for_in_peace(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also when a kernel should be called meanwhile: no processor is kept busy."""
    turns: list[float] = []
    may_tell = KernelSession._may_tell

    def counted(session: KernelSession, now_s: float) -> bool:
        turns.append(now_s)
        return may_tell(session, now_s)

    monkeypatch.setattr(KernelSession, "_may_tell", counted)
    with StubPasser() as passer, serving_kernels(path, passer.port, "absent") as world:
        wait_until(lambda: passer.texts("absent"), "the first call")
        passer.reads.clear()
        session = world.service._session
        assert session is not None
        for _ in range(3000):
            session.give("K1", (Atom("ANSWER"), "x" * 4000))
        wait_until(lambda: session._connection.waiting_bytes > MOST_WAITING_BYTES, "a full line")
        wait_until(lambda: (session._told.next_call_s or 0) < time.monotonic() - 0.5, "a call due")
        turns.clear()
        time.sleep(0.5)
        assert len(turns) < 50
        passer.reads.set()
        with passer.kernel("absent"):
            passer.wait_for("absent", ALL[-1])


def test_leaves_as_a_client_should(path: Path) -> None:
    """The passer is told; no message is left in its middle."""
    with StubPasser() as passer, passer.kernel("K1"):
        with serving_kernels(path, passer.port, "K1"):
            passer.wait_for("K1", ALL[-1])
            ours = passer.clients["SEMMAP"]
        assert ours.said_goodbye


@pytest.mark.parametrize(
    ("name", "told"), [("kill-mp", ()), ("A B", ()), ("A", ("K 1",)), ("A", ("A",)), ("A", ("",))]
)
def test_names_that_cannot_be(name: str, told: tuple[str, ...]) -> None:
    """They are refused before anything is begun."""
    with pytest.raises(PasserError, match="cannot be"):
        Kernels(TcpAddress("127.0.0.1", 1), name, told)


def test_many_ask_at_once(passer: StubPasser, world: KernelWorld) -> None:
    """Each gets its own answers."""

    def ask(name: str) -> None:
        with passer.kernel(name) as kernel:
            asks = (f"(ASK {number} (SET_DOOR_OPEN DOOR_3))" for number in range(20))
            got.extend(kernel.answer(text, str(number)) for number, text in enumerate(asks))

    got: list[str] = []
    threads = [threading.Thread(target=ask, args=(f"P{number}",)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    assert got == ["T"] * 160


def test_a_kernel_that_asks_much_holds_up_nobody(
    path: Path, passer: StubPasser, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where one is worked for at a time, another's question comes after the first of many."""
    monkeypatch.setattr(kernel_questions, "AT_ONCE", 1)
    with (
        serving_kernels(path, passer.port) as world,
        passer.kernel("K1") as much,
        passer.kernel("K2") as other,
    ):
        passer.wait_until_there("SEMMAP")
        answered: list[str] = []
        queues = world.service._questions._queues

        def answer(asked: AskedQuestion, client: str) -> Answer:
            answered.append(client)
            if len(answered) == 1:
                other.send("(ASK 9 (WHY DOOR_2))")
                wait_until(lambda: [4, 1] == [*map(len, queues.values())], "all ask")
            return Answer(value=True)

        monkeypatch.setattr(world.oracle, "answer", answer)
        for number in range(5):
            much.send(f"(ASK {number} (WHY DOOR_1))")
        wait_until(lambda: len(answered) == 6, "all answers")

    assert ["kernel K1", "kernel K2", *["kernel K1"] * 4] == answered


def test_a_message_that_is_too_long_is_not_read(kernel: StubKernel, world: KernelWorld) -> None:
    """Nor answered: it is none of ours."""
    kernel.send(f"(ASK 1 (NEXT_DOOR {'DOOR_1 ' * 10_000}))")

    wait_until(lambda: any("at most 65,536 bytes" in said for said in world.said), "a complaint")
    assert "T" == kernel.answer("(ASK 2 (DOOR_OPEN DOOR_1))", "2")
    said = kernel.answer(f"(ASK 3 (NEXT_DOOR {'DOOR_1 ' * 1000}))", "3")
    assert "expected at most 1,000 words" in said


@pytest.mark.parametrize("question", ["DOOR_OPEN {}", "WAIT_UNTIL {} OPEN 1"])
def test_an_error_of_our_own_is_answered(
    question: str, kernel: StubKernel, world: KernelWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the service goes on; nothing of it waits for ever."""

    def fail(*_: object) -> None:
        raise RuntimeError("of a test")

    monkeypatch.setattr(DoorView, "door", fail)
    answer = kernel.answer(f"(ASK 1 ({question.format('DOOR_1')}))", "1")
    monkeypatch.undo()

    assert answer == '(ERROR "RuntimeError: of a test")'
    assert kernel.answer("(ASK 2 (DOOR_OPEN DOOR_1))", "2") == "T"
    assert not world.service._questions._waits
    digits = '"' + "1" * 900 + '"'
    assert kernel.answer(f"(ASK 3 ({question.format(digits)}))", "3") == "NIL"


def test_a_passer_of_a_name_that_no_host_can_have() -> None:
    with pytest.raises(PasserError, match="no message passer at"):
        PasserConnection(TcpAddress("a" * 64, 3300), "SEMMAP")


def test_answers_that_nobody_takes_fill_no_memory(
    kernel: StubKernel, world: KernelWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that come at once, and those that are found later."""
    assert "NIL" == kernel.answer("(ASK up (DOOR_OPEN DOOR_99))", "up")  # from here on it serves
    session = world.service._session
    assert session is not None
    monkeypatch.setattr(kernel_service, "MOST_ANSWER_BYTES", 5000)
    monkeypatch.setattr(kernel_service, "MOST_WAITING_BYTES", 500)
    with monkeypatch.context() as silent:
        silent.setattr(PasserConnection, "send", lambda _: None)
        for number in range(100):
            kernel.send(f"(ASK {number} (HELP))")
            kernel.send(f"(ASK {number} (WHY DOOR_1))")
        wait_until(lambda: any("is not answered" in each for each in world.said), "the limit")
        for number in range(1000):
            session.give("K1", (Atom("ANSWER"), number, "x" * 100))
        wait_until(lambda: not world.service._questions._queues, "all questions to be looked at")
        assert session._connection.waiting_bytes + session._answers_bytes < 2 * 5000 + 5000
    session.wake()

    wait_until(lambda: not session._connection.waiting_bytes, "the passer to take all")
    assert 0 == session._answers_bytes
    assert kernel.answer("(ASK x (DOOR_OPEN DOOR_1))", "x") == "T"
