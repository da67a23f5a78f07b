"""What is believed after each look: against a loop over them that weighs by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from semmap_log.probabilities.chain.forgetting import Forgetting
from semmap_log.probabilities.chain.markov_chain import Rates
from semmap_log.probabilities.chain.nodes import CERTAIN_LLR, Looks, looks
from semmap_log.probabilities.evidence.evidence import DoorEvidence
from semmap_log.probabilities.forecast import LEAST
from semmap_log.probabilities.local_clock import LocalClock
from semmap_log.probabilities.methods.epoch import NEVER, believed
from semmap_log.probabilities.methods.schedule import DoorSchedule
from tests.probabilities.known import evidence, hours_ns

UTC = LocalClock("UTC")
FORGETTING = Forgetting(Rates(np.full(24, 1 / 9000), np.full(24, 1 / 15_000)), 30.0)


def a_patrolled_door() -> DoorEvidence:
    """Return three weeks of rounds, of which some come soon one after the other."""
    rng = np.random.default_rng(6)
    times = np.cumsum(rng.choice([0.01, 0.4, 3.0], 600))
    times = times[times < 24 * 21]
    reads = rng.random(len(times)) < 0.3
    return evidence(visits=list(zip(times.tolist(), reads.tolist(), strict=True)))


def test_a_belief_is_the_one_before_faded_to_the_schedule_and_weighed() -> None:
    """
    Look by look: what is kept of how far it was off, never without room for a surprise; then the
    odds times what was read.
    """
    told = a_patrolled_door()
    schedule = DoorSchedule(told, UTC)
    seen = looks(told, UTC, int(hours_ns(24 * 8)), int(hours_ns(24 * 15)))
    expected, belief = [], 0.0
    for i, (at_ns, llr) in enumerate(zip(seen.times_ns, seen.llr.tolist(), strict=True)):
        now, before = np.array([at_ns]), seen.times_ns[max(i - 1, 0)][None]
        here, was = schedule.p_open(now, now)[0], schedule.p_open(before, now)[0]
        gap_s = (at_ns - before[0]) / 1e9
        kept = math.exp(-gap_s * FORGETTING.rates.relaxation[0]) if i else 0.0
        least = LEAST * min(gap_s / 1800, 1.0)
        from_closed, from_open = here - kept * was, here + kept * (1 - was)
        p = (1 - belief) * max(from_closed, least) + belief * min(from_open, 1 - least)
        odds = p / (1 - p) * math.exp(llr)
        belief = odds / (1 + odds)
        expected.append(belief)

    found = believed(seen, schedule, FORGETTING, UTC)

    np.testing.assert_allclose(found.believed, expected, rtol=1e-9)
    assert np.ptp(found.believed) > 0.5


def test_a_belief_is_asked_for_as_of_the_look_before() -> None:
    """
    At a look and until the next one it is that look's; the last sighting may be of earlier.
    """
    seen = Looks(hours_ns([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 2.0, 0.0, -1.0]), np.arange(4) % 24)
    epoch = believed(seen, DoorSchedule(evidence(), UTC), FORGETTING, UTC)

    found = epoch.belief(hours_ns([-1.0, 0.5, 1.0, 2.5, 9.0]))

    assert epoch.believed[[0, 0, 1, 2, 3]].tolist() == found.p_open.tolist()
    assert hours_ns([0.0, 0.0, 1.0, 2.0, 3.0]).tolist() == found.told_ns.tolist()
    assert [NEVER, NEVER, *hours_ns([1.0, 1.0, 3.0]).tolist()] == found.seen_ns.tolist()


def test_what_is_seen_for_sure_is_not_unsure() -> None:
    """
    The spread of what leans on the schedule alone is the schedule's; a certain look leaves little.
    """
    schedule = DoorSchedule(evidence(), UTC)
    sure = np.array([0.0, CERTAIN_LLR, CERTAIN_LLR])
    seen = Looks(hours_ns([0.0, 1.0, 1.0]), sure, np.array([0, 1, 1]))

    found = believed(seen, schedule, FORGETTING, UTC)

    variance = schedule.expect(seen.times_ns, seen.times_ns).variance
    assert math.sqrt(variance[0]) == pytest.approx(found.spread[0])
    assert found.spread[1] < 0.01 * found.spread[0]
    assert found.spread[2] < 0.01 * found.spread[1]
