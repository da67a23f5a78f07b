"""Threads that share one log: at every level of durability, by luck and in drawn orders."""

from __future__ import annotations

import random
from collections.abc import Generator, Iterator
from itertools import islice

from fault_injection.fault import Outcome, Plan
from fault_injection.interleaving.schedules import schedules, try_schedule
from fault_injection.oracle_client import Oracle
from fault_injection.pool import side_by_side
from fault_injection.stress import LEVELS, Storm, try_storm

USUAL = 400
SCHEDULES_A_STORM = 10
"""Most faults need a rare order: drawing it finds them sooner than luck."""


def threads(plan: Plan) -> Generator[Outcome, None, None]:
    """Try orders of threads without end, on all cores; now and then many threads at once."""
    yield from side_by_side(_share, plan)


def _share(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    """Yield a share: the same ones for the same seed, whatever the others do."""
    with Oracle() as oracle:
        yield from islice(_endless(plan, share, shares, oracle), -(-plan.most(USUAL) // shares))


def _endless(plan: Plan, share: int, shares: int, oracle: Oracle) -> Iterator[Outcome]:
    dice = random.Random(f"storms {plan.seed} {share}")
    for turn, schedule in enumerate(islice(schedules(plan.seed), share, None, shares)):
        if turn % SCHEDULES_A_STORM == 0:
            level = LEVELS[turn // SCHEDULES_A_STORM % len(LEVELS)]
            yield try_storm(plan, Storm(level, dice.randrange(10**9)), oracle)
        yield try_schedule(plan, schedule, oracle)
