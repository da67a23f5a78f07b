"""Threads that share one log lose nothing, at any level, in any order that is drawn."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from fault_injection.fault import Plan
from fault_injection.interleaving.programs import PROGRAMS
from fault_injection.interleaving.schedules import Schedule, try_schedule
from fault_injection.oracle_client import Oracle

from tests.faults.running import faults, is_tried


@pytest.fixture
def oracle() -> Iterator[Oracle]:
    with Oracle() as oracle:
        yield oracle


@pytest.mark.slow
@pytest.mark.parametrize("program", PROGRAMS)
def test_drawn_orders(program: str, plan: Plan, oracle: Oracle) -> None:
    """Of each small program, where what is held back in memory makes most trouble."""
    for seed in range(12):
        outcome = try_schedule(plan, Schedule(0, program, "none", seed), oracle)

        assert outcome.is_good, outcome


@pytest.mark.slow
def test_the_kind_as_it_is_run(tmp_path: Path) -> None:
    """Programs and levels in turn, on all cores."""
    is_tried(faults("threads", 30, tmp_path), at_least=30)
