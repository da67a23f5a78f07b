"""What was believed of a door after each look, by each regime; and how far each was believed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.chain import matrix_scan, regimes
from semmap_log.analysis.probabilities.chain.looks import (
    LOOK_NS,
    held_at,
    is_certain,
    looks,
    seen_between,
)
from semmap_log.analysis.probabilities.evidence.day_tables import LONGEST_GAP_D, DayRows, Days
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import LEAST, MOST
from semmap_log.analysis.probabilities.methods.habits import shared_idly, weights_of_days
from semmap_log.analysis.probabilities.methods.schedule import DoorSchedule
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import HOUR_NS

Times = NDArray[np.int64]
Reals = NDArray[np.float64]

NEVER = 0
"""Of times: nanoseconds since 1970."""
LEADS_H = np.array([0.0, 2.0, 8.0, 24.0])
"""So far ahead regimes are scored; the first is the next look, whenever that is."""
TEMPER = 1 / (1 + 3 * LEADS_H)
"""How much of a look's likelihood counts: forecasts that overlap say the same again."""
SHARE = 0.01
"""The share of the weight that is redistributed each day."""
DOUBT = 0.5
"""All hours decide between regimes, and by night a door may behave otherwise than by day: until
today has shown more, the regime stays as doubtful as before anything was known."""
_CERTAIN = 1e-12
"""Of a variance: whoever sees a door again and again at once leaves none."""


class Belief(NamedTuple):
    """The beliefs at some times, and since when they hold."""

    p_open: Reals
    """(n, regimes): at the last look."""
    weight: Reals
    """(n, regimes): how far each was believed."""
    maybe: Reals
    """(n, regimes): how far each might be: see `DOUBT`."""
    spread: Reals
    """(n, regimes): standard deviation of P(open), where it rests on a schedule; else 0."""
    told_ns: Times
    """(n,): when that was."""
    seen_ns: Times
    """(n,): when the door was really seen, at that look or before; `NEVER`: it was not."""
    is_held: NDArray[np.bool_]
    """(n,): whether the state was known, and so is not a belief."""


class BeliefHistory:
    """The beliefs about a door after each look."""

    def __init__(self, evidence: DoorEvidence, schedule: DoorSchedule, clock: LocalClock) -> None:
        """Follow a door through all its evidence.

        Args:
            evidence: Of the door.
            schedule: Of the door.
            clock: Whose hours and days.
        """
        self._evidence, self._schedule, self._clock = evidence, schedule, clock
        self._looks = seen = looks(evidence, clock, evidence.until_ns)
        times_ns = seen.times_ns
        told_ns = np.concatenate([times_ns, evidence.seen_ns, [evidence.until_ns]])
        days = clock.hour_of(told_ns) // 24
        self._days = DayRows.of(days, days, after=LONGEST_GAP_D)
        self._row = np.maximum.accumulate(self._rows(times_ns))
        sees = np.maximum.accumulate(np.where(seen.sees, np.arange(len(seen)), -1))
        self._seen_ns = np.where(sees >= 0, times_ns[sees], NEVER)
        """(n,): when it was last really seen."""
        self._tends_to = schedule.p_open(times_ns, times_ns)
        """(n,): what the schedule forecast."""
        steps = self._steps(times_ns - seen.gap_ns, times_ns, self._tends_to)
        first = regimes.long_run(self._tends_to[:1])[0]
        self._p_open, before = matrix_scan.filtered(
            _certain_apart(steps, seen.llr), seen.llr, first
        )
        """(n, regimes)."""
        predicted = steps.predicted(before)
        self._spread = self._spreads(predicted)
        """(n, regimes)."""
        said = np.where(
            seen.llr[:, None] == 0, 0.0, np.log(matrix_scan.likelihood(predicted, seen.llr))
        )
        total = np.concatenate([np.zeros_like(said[:1]), np.cumsum(said, axis=0)])
        self._told = total[1:] - total[np.searchsorted(self._row, self._row)]
        """(n, regimes): log-likelihood of what was seen since midnight."""
        self._weights = self._weights_of_days(said)
        """(rows, leads, regimes): as each midnight knew them."""

    def at(self, known_ns: Times) -> Belief:
        """Return the belief at each time, or the state where it is known."""
        found = self._of_looks(known_ns)
        held, is_open = held_at(self._evidence, known_ns)
        sure = held[:, None]
        return Belief(
            np.where(sure, np.where(is_open, MOST, LEAST)[:, None], found.p_open),
            found.weight,
            found.maybe,
            np.where(sure, 0.0, found.spread),
            np.where(held, known_ns, found.told_ns),
            np.where(held, known_ns, found.seen_ns),
            held,
        )

    def _of_looks(self, known_ns: Times) -> Belief:
        """Return the belief from the looks so far.

        Sightings that are not all known yet are no look yet. The last look is always processed
        again, so that the belief is then the same to the last digit.
        """
        seen, evidence = self._looks, self._evidence
        place = np.maximum(np.searchsorted(seen.times_ns, known_ns, "right") - 1, 0)
        behind = np.searchsorted(evidence.seen_ns, known_ns, "right")
        is_last = (place > 0) & (seen.sightings[place] == behind)
        is_last &= seen.sightings[place - 1] < behind
        place = np.where(is_last, place - 1, place)
        p_open, told, row = self._p_open[place], self._told[place], self._row[place]
        told_ns, seen_ns = seen.times_ns[place], self._seen_ns[place]
        more = np.flatnonzero(seen.sightings[place] < behind)
        if len(more):
            last_ns = evidence.seen_ns[behind[more] - 1]
            llr = seen_between(evidence, seen.sightings[place[more]], behind[more])
            tends_to = self._schedule.p_open(last_ns, last_ns)
            predicted = self._steps(told_ns[more], last_ns, tends_to).predicted(p_open[more])
            p_open[more] = matrix_scan.weighed(
                np.where(is_certain(llr)[:, None], 0.5, predicted), llr
            )
            is_today = self._rows(last_ns) == row[more]
            told[more] = np.where(is_today[:, None], told[more], 0.0)
            told[more] += np.log(matrix_scan.likelihood(predicted, llr))
            row[more] = self._rows(last_ns)
            told_ns[more] = seen_ns[more] = last_ns
        likely = np.exp(told - told.max(1, keepdims=True))
        weights = self._weights[row, 0]
        doubted = weights + DOUBT * (regimes.PRIOR - weights)
        weight, maybe = (
            part / part.sum(1, keepdims=True) for part in (weights * likely, doubted * likely)
        )
        nowhere = np.zeros(len(place), np.bool_)
        return Belief(p_open, weight, maybe, self._spread[place], told_ns, seen_ns, nowhere)

    def weights(self, now: Reals, known_ns: Times, gap_ns: Times) -> Reals:
        """Return (n, regimes): how far each is believed some time ahead, by how it did so far.

        Args:
            now: (n, regimes), how far for the next look.
            known_ns: (n,), as it was known then.
            gap_ns: (n,), so far ahead.
        """
        day, gap_h = self._clock.hour_of(known_ns) // 24, gap_ns / HOUR_NS
        lead = np.searchsorted(LEADS_H[1:-1], gap_h, "right")
        here = np.where((lead == 0)[:, None], now, self._weights_at(day, lead))
        part = np.clip((gap_h - LEADS_H[lead]) / np.diff(LEADS_H)[lead], 0, 1)
        found: Reals = here + part[:, None] * (self._weights_at(day, lead + 1) - here)
        return found

    def kept(self, known_ns: Times, gap_ns: Times) -> Reals:
        """Return (n, gaps): what is left of a deviation after such times, by midnight's weights.

        Args:
            known_ns: (n,).
            gap_ns: (gaps,).
        """
        now = self._weights_at(self._clock.hour_of(known_ns) // 24, 0)
        found = [
            self.weights(now, known_ns, np.full(len(known_ns), gap)) @ of_gap
            for gap, of_gap in zip(gap_ns.tolist(), regimes.stays(gap_ns, gap_ns), strict=True)
        ]
        return np.stack(found, axis=1)

    def _weights_at(self, day: Days, lead: int | NDArray[np.intp]) -> Reals:
        """Return (n, regimes): how far each was believed as a day, (n,), began; `lead` places."""
        row = self._row_of(day)
        found: Reals = self._weights[row, lead]
        idle_d = day - self._days.days[row]
        between = np.flatnonzero(self._days.is_gap[row] & (idle_d > 0))
        if len(between):
            of_gap = found[between], regimes.PRIOR, SHARE, idle_d[between, None]
            found[between] = shared_idly(*of_gap)
        return found

    def _rows(self, times_ns: Times) -> NDArray[np.intp]:
        """Return the row of the day of each time; for later times, the last row."""
        return self._row_of(self._clock.hour_of(times_ns) // 24)

    def _row_of(self, day: Days) -> NDArray[np.intp]:
        return np.clip(self._days.row(day), 0, len(self._days) - 1)

    def _steps(self, from_ns: Times, to_ns: Times, tends_to: Reals) -> matrix_scan.Steps:
        """Return how the door may have changed, by what was known at the end, (n, regimes).

        Args:
            from_ns: (n,).
            to_ns: (n,).
            tends_to: (n,), what the schedule says at the end.
        """
        here = regimes.long_run(tends_to)
        before = regimes.long_run(self._schedule.p_open(from_ns, to_ns))
        kept = regimes.kept(to_ns - from_ns)
        # A surprise stays possible, by the half hour: looks in a row leave no room for a hundred.
        least = LEAST * np.minimum((to_ns - from_ns) / LOOK_NS, 1.0)[:, None]
        from_closed = np.clip(here - before * kept, least, 1 - least)
        return matrix_scan.Steps(
            from_closed, np.clip(here + (1 - before) * kept, from_closed, 1 - least)
        )

    def _spreads(self, predicted: Reals) -> Reals:
        """Return (n, regimes): how unsure each belief is.

        It leans on the one before, and on the schedule: a recurrence y = a y + b, as products of
        [[a, b], [0, 1]].
        """
        follows = ~regimes.IS_LEFT  # what is left as it is leans on no schedule
        after, predicted = self._p_open[:, follows], predicted[:, follows]
        moved = after * (1 - after) / np.maximum(predicted * (1 - predicted), _CERTAIN)
        moved[0] = 1.0
        kept = regimes.kept(self._looks.gap_ns)[:, follows]
        kept[0] = 0.0
        leans = np.sqrt(self._schedule.variance_of_hours(self._looks.times_ns))[:, None]
        steps = np.zeros((2, 2, *after.shape))
        steps[0, 0], steps[0, 1], steps[1, 1] = moved * kept, moved * (1 - kept) * leans, 1.0
        carried, one = matrix_scan.states(steps, np.repeat([[0.0], [1.0]], after.shape[1], axis=1))
        found = np.zeros_like(self._p_open)
        found[:, follows] = carried / one
        return found

    def _weights_of_days(self, said: Reals) -> Reals:
        """Return (rows, leads, regimes): how far each regime was believed at midnights.

        Args:
            said: (n, regimes), log-likelihood of each look, by what was known before it.
        """
        gain = np.stack(
            [said, *(self._loglik_before(lead_h) for lead_h in LEADS_H[1:].tolist())], 1
        )
        gain *= TEMPER[:, None]
        begins = np.flatnonzero(np.diff(self._row, prepend=-1))
        of_days = np.zeros((len(self._days), *gain.shape[1:]))
        of_days[self._row[begins]] = np.add.reduceat(gain, begins, axis=0)
        return weights_of_days(of_days, self._days, regimes.PRIOR, SHARE)[:-1]

    def _loglik_before(self, lead_h: float) -> Reals:
        """Return (n, regimes): log-likelihood of each look, by what was believed so long before."""
        seen = self._looks
        known_ns = seen.times_ns - round(lead_h * HOUR_NS)
        place = np.searchsorted(seen.times_ns, known_ns, "right") - 1
        scored = np.flatnonzero((seen.llr != 0) & (self._seen_ns[place] > NEVER) & (place >= 0))
        place, then_ns, known_ns = place[scored], seen.times_ns[scored], known_ns[scored]
        told_ns, seen_ns = seen.times_ns[place], self._seen_ns[place]
        each = regimes.ahead(
            self._p_open[place],
            self._tends_to[place],
            self._schedule.p_open(then_ns, known_ns),
            then_ns - told_ns,
            then_ns - seen_ns,
        )
        found = np.zeros_like(self._p_open)
        found[scored] = np.log(matrix_scan.likelihood(each, seen.llr[scored]))
        return found


def _certain_apart(steps: matrix_scan.Steps, llr: Reals) -> matrix_scan.Steps:
    """Return the same steps, but from either state as likely where what is seen says all."""
    sure = is_certain(llr)[:, None]
    return matrix_scan.Steps(
        *(np.where(sure, 0.5, part) for part in (steps.from_closed, steps.from_open))
    )
