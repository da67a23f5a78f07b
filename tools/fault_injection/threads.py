"""Threads that share one log: at every level of durability, by luck and in drawn orders."""

from __future__ import annotations

import random
from collections.abc import Generator, Iterator

from fault_injection.fault import Outcome, Plan
from fault_injection.interleaving.schedules import drawn_schedule, try_schedule
from fault_injection.oracle_client import Oracle
from fault_injection.pool import side_by_side
from fault_injection.stress import LEVELS, Storm, try_storm

USUAL = 400
STORM_EVERY = 11
"""Most faults need a rare order: drawing it finds them sooner than luck."""


def threads(plan: Plan) -> Generator[Outcome, None, None]:
    """Try drawn orders of threads, on all cores; now and then many threads at once."""
    yield from side_by_side(_share, plan)


def _share(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    with Oracle() as oracle:
        for turn in plan.turns(USUAL, share, shares):
            yield try_one(plan, turn, oracle)


def try_one(plan: Plan, turn: int, oracle: Oracle) -> Outcome:
    """Try what the seed and the turn alone decide."""
    dice = random.Random(f"{plan.seed} {turn}")
    if turn % STORM_EVERY == 0:
        level = LEVELS[turn // STORM_EVERY % len(LEVELS)]
        return try_storm(plan, Storm(turn, level, dice.randrange(10**9)), oracle)
    return try_schedule(plan, drawn_schedule(turn, dice), oracle)
