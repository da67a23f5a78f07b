"""What befalls a writer from within: interrupts, signals, no memory, no stack, spoilt events.

The short forms of `tools/faults.py interrupts signals`.
"""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from fault_injection.fault import Outcome
from fault_injection.interrupts import exhaust_the_stack, interrupt_anywhere, spoil_the_events
from fault_injection.ledger import Ledger
from fault_injection.signals import MOST_MEMORY, signalled, starved, stopped

import semmap_log as sl


def _bad(outcomes: list[Outcome]) -> list[Outcome]:
    return [outcome for outcome in outcomes if not outcome.is_good]


@pytest.mark.slow
def test_ctrl_c_at_any_step_leaves_nothing_by_half(memory: Path) -> None:
    """What was acknowledged is there, no id is given twice, and who goes on goes on rightly."""
    outcomes = list(interrupt_anywhere(memory, 3, 100))

    assert [] == _bad(outcomes)
    assert 100 == len(outcomes)


def test_no_stack_left(memory: Path) -> None:
    """A RecursionError in the middle of an append is an error like any other."""
    outcomes = list(exhaust_the_stack(memory, every=5))

    assert [] == _bad(outcomes)


@pytest.mark.slow
def test_events_that_cannot_be_had(memory: Path) -> None:
    """Whatever an iterator of events raises, and after how many of them: none of them is stored."""
    outcomes = list(spoil_the_events(memory))

    assert [] == _bad(outcomes)


@pytest.mark.slow
def test_signals_at_any_moment(memory: Path) -> None:
    """Ctrl-C, SIGTERM and SIGKILL to a process that appends: what it was told stays."""
    dice = random.Random(5)

    outcomes = [signalled(memory / str(n), dice) for n in range(15)]
    while not any(outcome.checked for outcome in outcomes) and len(outcomes) < 200:
        outcomes.append(signalled(memory / str(len(outcomes)), dice))  # busy: all were too early

    assert [] == _bad(outcomes)
    assert any(outcome.checked for outcome in outcomes)


def test_a_stopped_writer_keeps_its_place(memory: Path) -> None:
    """Readers read on, a second writer is refused, and afterwards it goes on where it stood."""
    outcome = stopped(memory / "log", 0.5)

    assert "" == outcome.problem
    assert outcome.is_good


@pytest.mark.slow
def test_memory_that_runs_out(memory: Path) -> None:
    """With none, some and almost enough: no commit by half, and small ones go on if they may."""
    outcomes = [
        starved(memory / str(n), MOST_MEMORY * n // 6) for n in range(6)
    ]  # fmt: skip

    assert [] == _bad(outcomes)
    assert all(outcome.checked >= 10 for outcome in outcomes)


def test_a_ledger_notices(memory: Path) -> None:
    """A door that was acknowledged and is not there is lost."""
    path, ledger = memory / "log", Ledger()
    with sl.create(path, tz="UTC") as log:
        ledger.add_doors(log, 3)
        log.add_door()
    ledger.note("stored", 7, 99)

    outcome = ledger.outcome(path, "nothing")

    assert (4, 1, 1) == (outcome.checked, outcome.lost, outcome.invented)
