"""Kernels that are kept informed, whoever comes and goes."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from semmap_log.oprs.expressions import Expression, ExpressionError, Symbol, Term, write
from semmap_log.oprs.message_passer import PasserClient
from semmap_log.oprs.passer_link import LinkSettings, PasserLink
from tests.live.network_namespace import NetworkNamespace, NoNamespaceError
from tests.live.running import DEADLINE_S, wait_until
from tests.oprs.building import MODULE
from tests.oprs.passer import Passer
from tests.oprs.workshop import PLANS as OPS
from tests.oprs.workshop import Workshop

STATE, DOOR, OPEN, CLOSED = map(Symbol, ("DOOR_STATE", "DOOR_3", "OPEN", "CLOSED"))


def _fact(state: Symbol) -> Expression:
    return Expression(STATE, (DOOR, state))


class Linked:
    """A link that runs, with one door."""

    def __init__(self, port: int) -> None:
        self.state = OPEN
        self.said: list[str] = []
        self.asked: list[Expression] = []
        settings = LinkSettings("SEMMAP", ["K1", "K2"], lambda: [_fact(self.state)], self._answer,
                    self.said.append)  # fmt: skip
        self.link = PasserLink(
            lambda: PasserClient.connect("127.0.0.1", port, "SEMMAP"), settings, retry_s=0.02
        )
        self.thread = threading.Thread(target=self.link.run, daemon=True)

    def _answer(self, question: Expression) -> Term:
        self.asked.append(question)
        if question.name != "DOOR_OPEN":
            raise ExpressionError(f"no question {question.name}.")
        return 0.1 + 0.2

    def change(self, state: Symbol) -> None:
        """Change the door, as a server would."""
        self.state = state
        self.link.post([_fact(state)])


@pytest.fixture
def passer() -> Iterator[Passer]:
    """A passer on some port."""
    with Passer() as one:
        yield one


@pytest.fixture
def linked(passer: Passer) -> Iterator[Linked]:
    """A link to it; the test's end stops it."""
    one = Linked(passer.port)
    one.thread.start()
    wait_until(lambda: any("is registered" in said for said in one.said), "it to be registered")
    yield one
    one.link.stop()
    one.thread.join(DEADLINE_S)
    assert not one.thread.is_alive()


def _kernel(passer: Passer, name: str) -> PasserClient:
    return PasserClient.connect("127.0.0.1", passer.port, name, timeout_s=DEADLINE_S)


def _receive(kernel: PasserClient) -> str:
    message = kernel.receive(DEADLINE_S)
    assert message is not None
    assert "SEMMAP" == message.sender
    return message.text


def _receive_until(kernel: PasserClient, last: Expression) -> list[str]:
    texts = [_receive(kernel)]
    while texts[-1] != write(last):
        texts.append(_receive(kernel))
    return texts


def test_facts_when_a_kernel_comes_and_at_each_change(passer: Passer, linked: Linked) -> None:
    """
    One kernel comes late, the other never: no matter to the first.
    """
    wait_until(lambda: sum("is not there" in said for said in linked.said) == 2, "both missing")

    with _kernel(passer, "K1") as kernel:
        assert write(_fact(OPEN)) == _receive(kernel)
        wait_until(lambda: "K1: is there now." in linked.said, "K1 to be found")
        linked.change(CLOSED)
        linked.change(OPEN)
        texts = _receive_until(kernel, _fact(CLOSED))
        assert {write(_fact(OPEN)), write(_fact(CLOSED))} == set(texts)
        assert write(_fact(OPEN)) == _receive(kernel)
    assert "K2: is there now." not in linked.said


def test_changes_from_before_the_facts_are_not_told(passer: Passer) -> None:
    """
    They are in the facts: told behind them, they would undo what is newer.
    """
    linked = Linked(passer.port)
    linked.link.post([_fact(CLOSED)])
    with _kernel(passer, "K1") as kernel:
        linked.thread.start()
        assert write(_fact(OPEN)) == _receive(kernel)
        linked.change(Symbol("MOVING"))
        assert write(_fact(Symbol("MOVING"))) == _receive(kernel)
        linked.link.stop()
        linked.thread.join(DEADLINE_S)


def test_a_kernel_is_found_however_much_happens(passer: Passer, linked: Linked) -> None:
    """
    Changes without end leave no moment in which nothing is to be done.
    """
    ended = threading.Event()

    def change() -> None:
        while not ended.wait(0.001):
            linked.change(CLOSED)

    changing = threading.Thread(target=change)
    changing.start()
    try:
        wait_until(lambda: any(s.startswith("K1: is not") for s in linked.said), "K1 missed")
        with _kernel(passer, "K1") as kernel:
            _receive_until(kernel, _fact(CLOSED))
            wait_until(lambda: "K1: is there now." in linked.said, "K1 to be found")
    finally:
        ended.set()
        changing.join(DEADLINE_S)


def test_a_kernel_that_was_restarted_gets_all(passer: Passer, linked: Linked) -> None:
    """
    The next change finds that it is not there; from then on it is looked for.
    """
    with _kernel(passer, "K1") as kernel:
        _receive_until(kernel, _fact(OPEN))
    wait_until(lambda: "K1" not in passer.clients, "K1 to be gone")
    linked.change(CLOSED)
    wait_until(lambda: any(said.startswith("K1: is not") for said in linked.said), "K1 missed")

    with _kernel(passer, "K1") as kernel:
        _receive_until(kernel, _fact(CLOSED))


def test_a_passer_that_comes_back(passer: Passer) -> None:
    """
    Killed, and started again under the same port: registered again, all facts told again.
    """
    linked = Linked(passer.port)
    linked.thread.start()
    with _kernel(passer, "K1") as kernel:
        _receive_until(kernel, _fact(OPEN))
    passer.__exit__()
    linked.change(CLOSED)
    wait_until(lambda: any("It is tried again." in said for said in linked.said), "it to be missed")

    with Passer(passer.port) as again, _kernel(again, "K2") as kernel:
        assert [write(_fact(CLOSED))] == _receive_until(kernel, _fact(CLOSED))
        linked.link.stop()
        linked.thread.join(DEADLINE_S)
    assert 2 == sum("is registered" in said for said in linked.said)


def test_questions(passer: Passer, linked: Linked) -> None:
    """
    Answered under their id, to the last digit, to whoever asks; what is none is refused with why.
    """
    with _kernel(passer, "K9") as kernel:
        ask, door_open = Symbol("ASK"), Expression(Symbol("DOOR_OPEN"), (DOOR, "14:02"))
        kernel.send("SEMMAP", Expression(ask, (17, door_open)))
        assert "(ANSWER 17 0.30000000000000004)" == _receive(kernel)
        kernel.send("SEMMAP", Expression(ask, (Symbol("Q2"), Expression(Symbol("FOO")))))
        assert '(ANSWER Q2 ERROR "no question FOO.")' == _receive(kernel)
        kernel.send("SEMMAP", Expression(Symbol("DOOR_FACTS")))
        assert write(_fact(OPEN)) == _receive(kernel)
        kernel.send("SEMMAP", Expression(ask, (door_open,)))
        wait_until(lambda: any(said.startswith("K9: expected") for said in linked.said), "a word")

    assert [door_open, Expression(Symbol("FOO"))] == linked.asked


def test_nobody_speaks_for_the_passer(passer: Passer, linked: Linked) -> None:
    """
    A kernel that says that another is unknown, or that we have tried, changes nothing.
    """
    with _kernel(passer, "K1") as kernel, _kernel(passer, "K9") as liar:
        _receive_until(kernel, _fact(OPEN))
        before = [said for said in linked.said if said.startswith("K1: is not there")]
        liar.send("SEMMAP", Expression(Symbol("unknown"), (Symbol("K1"),)))
        liar.send("SEMMAP", Expression(Symbol("SEMMAP_TRIED"), (1,)))
        wait_until(lambda: sum(s.startswith("K9: expected") for s in linked.said) == 2, "words")
        linked.change(CLOSED)
        _receive_until(kernel, _fact(CLOSED))

    assert before == [said for said in linked.said if said.startswith("K1: is not there")]


PLANS = """(
(defop SEND :invocation (! (SEND-MESSAGE $TO $M)) :action (SEND-MESSAGE $TO $M))
(defop SEEN :invocation (DOOR_STATE $D $S) :body (
  (! (SAY (SEEN $D $S)))
  (! (SEND-MESSAGE SEMMAP (ASK 17 (DOOR_OPEN $D "14:02"))))))
(defop ANSWERED :invocation (ANSWER $ID $VALUE) :body (
  (IF (? (DOOR_STATE DOOR_3 $S)) (! (SAY (ANSWERED $ID $VALUE))))))
)
"""


@pytest.mark.slow
def test_real_kernels_and_a_real_passer_that_is_killed(workshop: Workshop) -> None:
    """
    Facts trigger plans, which ask; kernels go with their passer, the link comes back with the next.
    """
    try:
        network = NetworkNamespace.open()
    except NoNamespaceError as error:
        pytest.skip(str(error))
    workshop.stack.callback(network.close)
    plans = workshop.folder / "link.opf"
    plans.write_text(PLANS, encoding="utf-8")
    passer = [str(workshop.oprs.program.with_name("mp-oprs")), "-j", "3300"]
    kernel = [
        str(workshop.oprs.program), "-a", "-q", "-l", "none", "-m", "127.0.0.1", "-j", "3300",
        "-n", "K1", "-x", str(MODULE / "door_facts.inc"), "-c", f'load opf "{OPS}"',
        "-c", f'load opf "{plans}"',
    ]  # fmt: skip
    program = str(Path(__file__).parent / "link_program.py")
    link = workshop.run(network.inside([sys.executable, program]))
    link.wait_for("refused. It is tried again")

    for times in (1, 2):
        running = workshop.run(network.inside(passer))
        running.wait_for("Message passer running")
        link.wait_for(rf"(?s)(is registered.*){{{times}}}")
        told = workshop.run(network.inside(kernel))
        for state in ("OPEN", "CLOSED"):
            told.wait_for(rf"^\(SEEN DOOR_3 {state}\)")
        told.wait_for(r'^\(ANSWERED 17 \(\.a "b"\\  \(DOOR_OPEN DOOR_3 14:02\) \.\)\)')
        link.wait_for("K1: is there now")
        assert "K2: is there now" not in link.output
        running.process.kill()
        assert told.process.wait(DEADLINE_S) == 1  # a kernel goes with its passer
