"""What was believed after each look: against loops over them that weigh by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from semmap_log.analysis.probabilities.chain import regimes
from semmap_log.analysis.probabilities.chain.looks import LOOK_NS, looks
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import LEAST
from semmap_log.analysis.probabilities.methods.belief_history import (
    LEADS_H,
    NEVER,
    SHARE,
    TEMPER,
    BeliefHistory,
)
from semmap_log.analysis.probabilities.methods.schedule import DoorSchedule
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import HOUR_NS
from tests.analysis.probabilities.chains import stretches_of
from tests.analysis.probabilities.known import evidence, hours_ns

UTC = LocalClock("UTC")
DAYS = 12
LEFT_CLOSED = len(regimes.PACES_H)


def a_patrolled_door(days: float = DAYS) -> DoorEvidence:
    """Return rounds, of which some come soon one after the other, and a day without any."""
    rng = np.random.default_rng(6)
    times = np.cumsum(rng.choice([0.02, 0.4, 3.0], 600))
    times = times[(times < 24 * days) & (times // 24 != 5)]
    reads = rng.random(len(times)) < 0.3
    visits = list(zip(times.tolist(), reads.tolist(), strict=True))
    return evidence(visits=visits).up_to(int(hours_ns(24 * days)))


def history_of(told: DoorEvidence) -> BeliefHistory:
    return BeliefHistory(told, DoorSchedule(told, UTC), UTC)


def at(when: float) -> np.ndarray:
    return hours_ns([when])


class ByHand:
    """One regime after the other, look after look, in plain numbers."""

    def __init__(self, told: DoorEvidence) -> None:
        self.schedule = DoorSchedule(told, UTC)
        self.seen = looks(told, UTC, told.until_ns)
        self.times = self.seen.times_ns.tolist()
        many = len(regimes.PRIOR)
        self.believed, self.said = zip(*(self.follow(k) for k in range(many)), strict=True)

    def p_schedule(self, at_ns: int, known_ns: int) -> float:
        return float(self.schedule.p_open(np.array([at_ns]), np.array([known_ns]))[0])

    def long_run(self, regime: int, schedule: float) -> float:
        left = {LEFT_CLOSED: 1 - regimes.LEFT_P, LEFT_CLOSED + 1: regimes.LEFT_P}
        return left.get(regime, schedule)

    def follow(self, regime: int) -> tuple[list[float], list[float]]:
        """Return P(open) after each look, and its log-likelihood."""
        belief, after, said, last = 0.0, [], [], self.times[0]
        for i, (at_ns, llr) in enumerate(zip(self.times, self.seen.llr.tolist(), strict=True)):
            here = self.long_run(regime, self.p_schedule(at_ns, at_ns))
            was = self.long_run(regime, self.p_schedule(last, at_ns))
            gap_h = (at_ns - last) / HOUR_NS
            least = LEAST * min((at_ns - last) / LOOK_NS, 1.0)
            kept = math.exp(-gap_h / regimes.PACE_H[regime])
            if i == 0:
                belief = here
            from_closed = max(here - kept * was, least)
            from_open = min(here + kept * (1 - was), 1 - least)
            p = (1 - belief) * from_closed + belief * from_open if i else here
            sees = 1 / (1 + math.exp(-llr))
            seen = p * sees + (1 - p) * (1 - sees)
            belief, last = p * sees / seen, at_ns
            after.append(belief)
            said.append(math.log(seen) if llr else 0.0)
        return after, said

    def said_before(self, i: int, lead_h: float) -> list[float]:
        """Return the log-likelihood of a look by what each regime said so long before."""
        known_ns = self.times[i] - round(lead_h * HOUR_NS)
        known = [j for j, at_ns in enumerate(self.times) if at_ns <= known_ns]
        if not known or not self.seen.llr[i] or not self.seen.llr[: known[-1] + 1].any():
            return [0.0] * len(regimes.PRIOR)
        told = self.times[known[-1]]
        then, was = self.p_schedule(self.times[i], known_ns), self.p_schedule(told, told)
        gap_h, sees = (self.times[i] - told) / HOUR_NS, 1 / (1 + math.exp(-self.seen.llr[i]))
        found = []
        for k in range(len(regimes.PRIOR)):
            moved = math.exp(-gap_h / regimes.PACE_H[k]) * (
                self.believed[k][known[-1]] - self.long_run(k, was)
            )
            p = self.long_run(k, then) + moved
            if k >= LEFT_CLOSED:
                p = then + math.exp(-gap_h / regimes.LEFT_LASTS_H) * (p - then)
            p = min(max(p, 0.001), 0.999)
            found.append(math.log(p * sees + (1 - p) * (1 - sees)))
        return found

    def weights(self, lead: int, days: int) -> list[list[float]]:
        """Return how far each regime is believed at each midnight."""
        prior = regimes.PRIOR.tolist()
        found = [prior]
        first = self.times[0] // (24 * HOUR_NS)
        for day in range(days - 1):
            gain = [0.0] * len(prior)
            for i, at_ns in enumerate(self.times):
                if at_ns // (24 * HOUR_NS) - first == day:
                    told = (
                        [said[i] for said in self.said] if lead == 0
                        else self.said_before(i, float(LEADS_H[lead]))
                    )  # fmt: skip
                    gain = [a + TEMPER[lead] * b for a, b in zip(gain, told, strict=True)]
            each = [w * math.exp(g - max(gain)) for w, g in zip(found[-1], gain, strict=True)]
            found.append([
                (1 - SHARE) * w / sum(each) + SHARE * p for w, p in zip(each, prior, strict=True)
            ])  # fmt: skip
        return found


@pytest.fixture(scope="module")
def by_hand() -> ByHand:
    return ByHand(a_patrolled_door())


@pytest.fixture(scope="module")
def history() -> BeliefHistory:
    return history_of(a_patrolled_door())


def test_a_belief_is_the_one_before_faded_and_weighed(
    by_hand: ByHand, history: BeliefHistory
) -> None:
    """What is kept of a deviation fades, with room for a surprise; then the odds are weighed."""
    found = history.at(by_hand.seen.times_ns)

    np.testing.assert_allclose(found.p_open[1:], np.array(by_hand.believed).T[1:], rtol=1e-7)
    assert np.ptp(found.p_open) > 0.9
    assert by_hand.times[1:] == found.told_ns[1:].tolist() == found.seen_ns[1:].tolist()


@pytest.mark.parametrize("lead", range(len(LEADS_H)))
def test_midnights_weigh_regimes_by_what_they_foretold(
    by_hand: ByHand, history: BeliefHistory, lead: int
) -> None:
    """At each lead by forecasts of that lead."""
    midnights_ns = hours_ns(24.0 * np.arange(DAYS))
    nothing = np.full((DAYS, len(regimes.PRIOR)), np.nan)
    gap_ns = np.full(DAYS, round(LEADS_H[lead] * HOUR_NS))
    gap_ns += lead == 0  # a moment ahead: what is seen now has no say, midnight's weights have

    found = (
        history._weights[:DAYS, 0] if lead == 0
        else history.weights(nothing if lead > 1 else 0 * nothing, midnights_ns, gap_ns)
    )  # fmt: skip

    np.testing.assert_allclose(found, by_hand.weights(lead, DAYS), rtol=1e-6)


def test_what_is_seen_today_counts_at_once_for_what_is_next(
    by_hand: ByHand, history: BeliefHistory
) -> None:
    """Midnight's weights times the likelihood of what was seen since."""
    noon = 24 * 8 + 12.0
    midnight = by_hand.weights(0, DAYS)[8]
    today = [i for i, at_ns in enumerate(by_hand.times)
             if hours_ns(24.0 * 8) <= at_ns <= hours_ns(noon)]  # fmt: skip
    each = [
        w * math.exp(sum(said[i] for i in today))
        for w, said in zip(midnight, by_hand.said, strict=True)
    ]

    found = history.at(at(noon)).weight[0]

    np.testing.assert_allclose(found, np.array(each) / sum(each), rtol=1e-6)


def test_a_new_day_begins_with_midnights_weights() -> None:
    """Seen just behind midnight: what was seen before it is in the weights of midnight already."""
    rng = np.random.default_rng(2)
    rounds = [(0.5 * i + 0.2, rng.random() < 0.3) for i in range(9 * 48)]
    told = evidence(visits=[*rounds, (24.0 * 9 + 0.1, True)]).up_to(int(at(24.0 * 9 + 0.2)[0]))
    by_hand = ByHand(told)
    each = [
        w * math.exp(said[-1])
        for w, said in zip(by_hand.weights(0, 10)[9], by_hand.said, strict=True)
    ]

    found = history_of(told).at(at(24.0 * 9 + 0.1)).weight[0]

    np.testing.assert_allclose(found, np.array(each) / sum(each), rtol=1e-6)


def test_between_leads_weights_are_in_between(history: BeliefHistory) -> None:
    """A line from lead to lead; beyond the last one it stays."""
    now = history.at(at(200.0)).weight
    of = {
        hours: history.weights(now, at(200.0), np.array([round(hours * HOUR_NS)]))
        for hours in (0, 1, 2, 5, 8, 24, 500)
    }

    np.testing.assert_allclose(of[0], now)
    np.testing.assert_allclose(of[1], (now + of[2]) / 2)
    np.testing.assert_allclose(of[5], (of[2] + of[8]) / 2)
    np.testing.assert_allclose(of[500], of[24])


def test_before_the_first_look_nothing_was_seen(history: BeliefHistory) -> None:
    """However early one asks."""
    found = history.at(hours_ns([-1000.0, 0.0]))

    assert [NEVER, NEVER] == found.seen_ns.tolist()
    np.testing.assert_allclose(found.weight[0], regimes.PRIOR)


def a_pass() -> DoorEvidence:
    """Return two weeks of rounds, then a pass that looks each second for two minutes."""
    rounds = [(0.5 * i, i % 5 == 0) for i in range(600)]
    close = [(301.0 + i / 3600, i % 3 != 0) for i in range(120)]
    told = evidence(visits=rounds + close)
    llr = np.append(told.llr[:600], np.linspace(2.0, -0.5, 120))
    return replace(told, llr=llr)


@pytest.mark.parametrize("hour", [301.0, 301.01, 301.02, 301.03, 301.5, 302.0])
def test_in_the_midst_of_a_pass_it_is_as_if_that_were_all(hour: float) -> None:
    """To the last digit: whoever knows the rest of the pass, too, gets no other answer for then."""
    whole, then = a_pass(), a_pass().up_to(int(at(hour)[0]))

    found, expected = (history_of(told).at(at(hour)) for told in (whole, then))

    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)


def test_each_sighting_of_a_pass_counts_as_it_comes() -> None:
    """What is believed rises from sighting to sighting, and is the last one's from then on."""
    told = a_pass()
    first_s = [0, 1, 2, 5]

    found = history_of(told).at(hours_ns([301.0 + s / 3600 for s in first_s]))

    believed = (found.p_open * found.weight).sum(1)
    assert (np.diff(believed) > 0).all()
    np.testing.assert_allclose((found.told_ns - hours_ns(301.0)) / 1e9, first_s)


def test_what_is_known_for_sure_is_not_unsure() -> None:
    """A state that was set; and behind its end less surely again."""
    told = evidence([(0.0, 50.0, True)], visits=[(60.0, True)])

    found = history_of(told).at(hours_ns([49.0, 60.0, 61.0]))

    assert [True, False, False] == found.is_held.tolist()
    assert (found.p_open[0] == 0.999).all()
    assert not found.spread[0].any()
    assert found.spread[1].max() > 0


def test_a_door_that_nobody_uses_any_more_is_left() -> None:
    """Open off and on for ten days, shut ever since: after two days that is what is believed."""
    used = stretches_of(240.0, 4.0, 4.0, np.random.default_rng(3))
    told = evidence([*used, (240.0, 24.0 * 14, False)]).up_to(int(hours_ns(24.0 * 14)))
    history = history_of(told)

    in_use, left = (history.at(at(24.0 * day)).weight[0, LEFT_CLOSED] for day in (9.5, 12.5))

    assert in_use < 0.01
    assert left > 0.8
