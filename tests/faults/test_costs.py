"""Small hostile inputs: an answer's memory and time are near those of a harmless twin."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest
from fault_injection import costs as measuring
from fault_injection.costs import MORE_MIB, MORE_S, Bench, Measured, measured, too_much
from fault_injection.fault import Plan
from fault_injection.questions import Answer

from tests.faults.running import faults, is_tried

GOOD = Answer(0, "")
TWIN = Measured(GOOD, 0.1, 5)


def _measured(work: Callable[[], object], room: Path, monkeypatch: pytest.MonkeyPatch) -> Measured:
    """Return what is measured of a verb that does that."""

    def verb(*_: object, **__: object) -> Answer:
        work()
        return GOOD

    monkeypatch.setattr(measuring, "ask_verb", verb)
    return measured(("info",), room)


def test_what_takes_as_much_as_its_twin_is_good(
    memory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It ends, and says what it says."""
    found = _measured(lambda: None, memory, monkeypatch)

    assert GOOD == found.answer
    assert "" == too_much(found, TWIN, MORE_S)


def test_memory_above_the_twin_is_noticed(memory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also what was freed again; and more than there may be is refused to who asks for it."""
    found = _measured(lambda: b"x" * (MORE_MIB + 30) * 2**20, memory, monkeypatch)
    refused = _measured(lambda: bytearray(2**32), memory, monkeypatch)

    assert "MiB more than at its start" in too_much(found, TWIN, MORE_S)
    assert "exit code 3" in too_much(refused, TWIN, MORE_S)


def _spin() -> None:
    while True:
        pass


def test_work_without_end_is_ended(memory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work by its seconds of a processor; waiting, which takes none, by the clock."""
    monkeypatch.setattr(measuring, "LONGEST_S", 1)
    monkeypatch.setattr(measuring, "DEADLINE_S", 1)
    hung = _measured(lambda: time.sleep(1000), memory, monkeypatch)
    monkeypatch.setattr(measuring, "DEADLINE_S", 100)
    worked = _measured(_spin, memory, monkeypatch)

    assert "SIGALRM" in too_much(hung, TWIN, MORE_S)
    assert "SIGXCPU" in too_much(worked, TWIN, MORE_S)


def test_logs_and_questions_that_are_hostile(plan: Plan) -> None:
    """A costly log, a question with a bound that is far away, a log of a stranger."""
    bench = Bench(plan, plan.folder / "bench")

    outcomes = [bench.try_one(turn) for turn in (1, 3, 7, 12, 13)]

    assert [] == [outcome for outcome in outcomes if not outcome.is_good]


@pytest.mark.slow
def test_no_small_input_takes_the_machine(tmp_path: Path) -> None:
    """Logs, questions, and logs of strangers, for every verb."""
    is_tried(faults("costs", 40, tmp_path), at_least=40)
