"""A door's evidence as a chain takes it: looks at certain times, and what each saw.

It also measures how well modes explain the looks, hour by hour.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.chain import hour_modes
from semmap_log.analysis.probabilities.chain.matrix_scan import Steps, states, step_matrices
from semmap_log.analysis.probabilities.evidence.day_tables import DayRows
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.evidence.visits import MOST_ACCURACY
from semmap_log.core.folds.timeline import PASS_NS
from semmap_log.core.model.local_clock import HOUR_S, LocalClock
from semmap_log.core.model.moments import HOUR_NS, SECOND_NS

Reals = NDArray[np.float64]

HOURS_AT_ONCE = 256
"""Hours whose steps are computed together: more would fill memory."""


class HourLooks:
    """The looks of each hour, as the transitions of the state that they imply in each mode."""

    def __init__(self, looks: Looks, clock: LocalClock) -> None:
        """Go through looks at a door.

        Args:
            looks: One in each half hour at least, be it blind.
            clock: Whose hours.
        """
        gap_ns = looks.gap_ns
        hour = np.maximum.accumulate(clock.hour_of(looks.times_ns - gap_ns // 2))
        begins = np.flatnonzero(np.diff(hour, prepend=hour[:1] - 1))
        self.hour = hour[begins]
        """(hours,): their numbers, ascending, as in `LocalClock.hour_of`."""
        self._through = _through(gap_ns / HOUR_NS, looks.llr, begins)

    def explained(self, likely: Reals | None) -> Reals:
        """Return the log-likelihood of what was seen in each hour, (hours, modes).

        Args:
            likely: (hours, modes): how likely each is in each mode, so that what was seen before
                and after speaks, too; None: each hour stands alone.
        """
        if likely is None:
            first = np.stack([1 - hour_modes.SHARE, hour_modes.SHARE])[:, None]
            later = np.ones((2, len(self.hour)))
        else:
            mean = (self._through * likely).sum(-1, keepdims=True)
            even = np.full((2, 1), 0.5)
            before = states(mean, even)[..., 0]
            after = states(mean.swapaxes(0, 1)[:, :, ::-1], even)[:, ::-1, 0]
            first = np.concatenate([even, before[:, :-1]], axis=1)[..., None]
            later = np.concatenate([after[:, 1:], even], axis=1)
        reached = self._through[:, 0] * first[0] + self._through[:, 1] * first[1]
        return np.asarray(np.log(reached[0] * later[0, :, None] + reached[1] * later[1, :, None]))


def _through(gap_h: Reals, llr: Reals, begins: NDArray[np.intp]) -> Reals:
    """Return (2, 2, hours, modes): transitions from the state before each hour to that after it."""
    lasts = np.diff(np.append(begins, len(llr)))
    found = np.zeros((2, 2, len(begins), len(hour_modes.SHARE)))
    found[0, 0] = found[1, 1] = 1.0
    for start in range(0, len(begins), HOURS_AT_ONCE):
        for number in range(int(lasts[start : start + HOURS_AT_ONCE].max())):
            on = start + np.flatnonzero(lasts[start : start + HOURS_AT_ONCE] > number)
            place = begins[on] + number
            kept = np.exp(-gap_h[place][:, None] * hour_modes.PER_H)
            from_closed = (1 - kept) * hour_modes.SHARE
            step = step_matrices(Steps(from_closed, from_closed + kept), llr[place])
            so_far = found[:, :, on]
            found[:, :, on] = step[:, 0, None] * so_far[0] + step[:, 1, None] * so_far[1]
    return found


Times = NDArray[np.int64]
Places = NDArray[np.intp]

LOOK_NS = HOUR_S * SECOND_NS // 2
"""Where the state is known throughout, a look each half hour sees it: the pace of a patrol."""
CERTAIN_LLR = float(np.log(MOST_ACCURACY / (1 - MOST_ACCURACY)))
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class Looks:
    """Looks at a door, ascending. The first one saw nothing.

    Sightings of the same five minutes are one look, at the last of them, so that their number costs
    nothing. A certain one is a look of its own.
    """

    times_ns: Times
    """(n,)."""
    llr: NDArray[np.float64]
    """(n,): 0 where nothing was seen."""
    sightings: Places
    """(n,): how many of the door's sightings are taken in up to there."""

    def __len__(self) -> int:
        return len(self.times_ns)

    @property
    def gap_ns(self) -> Times:
        """(n,): since the look before; 0 at the first."""
        return np.diff(self.times_ns, prepend=self.times_ns[:1])

    @property
    def sees(self) -> NDArray[np.bool_]:
        """(n,): something was seen, even if readings cancelled each other."""
        return np.asarray((self.llr != 0) | (np.diff(self.sightings, prepend=0) > 0), np.bool_)


def is_certain(llr: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which readings, or stretches, are certain."""
    return np.abs(llr) > CERTAIN_LLR - _ROUNDING


def looks(
    evidence: DoorEvidence, clock: LocalClock, until_ns: int, *, blind_from_ns: int | None = None
) -> Looks:
    """Return the looks at a door.

    Args:
        evidence: Of the door.
        clock: Whose half hours.
        until_ns: Later evidence is left out.
        blind_from_ns: From then on a look, too, in each half hour in which nothing was seen, and
            none of what came before; None: no such looks.
    """
    grid_ns = _half_hours_ns(evidence, clock, until_ns, blind_from_ns)
    held, is_open = held_at(evidence, grid_ns)
    on = held | (blind_from_ns is not None)
    ends, seen = _last_known(evidence), np.flatnonzero(_ends_look(evidence))
    parts = (
        (np.array([evidence.first_ns]), np.zeros(1)),
        (grid_ns[on], np.where(held, _certain(is_open), 0.0)[on]),
        (evidence.end_ns[ends], _certain(evidence.is_open[ends])),
        (evidence.seen_ns[seen], seen_between(evidence, np.append(-1, seen[:-1]) + 1, seen + 1)),
    )
    times_ns, llr = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    order = np.argsort(times_ns, kind="stable")
    times_ns = times_ns[order]
    taken_in = np.append(0, seen + 1)[np.cumsum(order >= len(order) - len(seen))]
    first = 0 if blind_from_ns is None else int(np.searchsorted(times_ns, blind_from_ns))
    inside = slice(first, int(np.searchsorted(times_ns, until_ns, "right")))
    return Looks(times_ns[inside], llr[order][inside], taken_in[inside])


def _half_hours_ns(
    evidence: DoorEvidence, clock: LocalClock, until_ns: int, blind_from_ns: int | None
) -> Times:
    """Return all half hours that may be looks: where the state is held, or all that are blind."""
    if blind_from_ns is not None:
        ends_ns = np.array([max(evidence.first_ns, blind_from_ns), until_ns], np.int64)
        first, last = np.sort(clock.hour_of(ends_ns)).tolist()
        hours_ns = clock.hours(first, last + 1).start_ns
    elif len(evidence.start_ns):
        days = (clock.hour_of(ns) // 24 for ns in (evidence.start_ns, evidence.end_ns))
        hours_ns = DayRows.of(*days).hours(clock).start_ns
    else:
        return np.empty(0, np.int64)
    return np.stack([hours_ns, hours_ns + LOOK_NS], axis=1).ravel()


def seen_between(evidence: DoorEvidence, first: Places, behind: Places) -> NDArray[np.float64]:
    """Return the sum of each look's sightings, nats, (n,).

    Args:
        evidence: Of the door.
        first: (n,), the first sighting of each.
        behind: (n,), the one after the last; equal to `first`: no sighting, 0.
    """
    alone = np.clip(evidence.llr, -CERTAIN_LLR, CERTAIN_LLR)
    certain = is_certain(alone)
    total = np.append(0.0, np.cumsum(np.where(certain, 0.0, alone)))
    most = CERTAIN_LLR - 2 * _ROUNDING
    found = np.clip(total[behind] - total[first], -most, most)
    sure = np.append(False, certain)[behind] & (behind > first)
    found[sure] = alone[behind[sure] - 1]
    return np.asarray(found, np.float64)


def held_at(evidence: DoorEvidence, times_ns: Times) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return whether the state is known at each time, and whether it is open then."""
    if not len(evidence.start_ns):
        nowhere = np.zeros(len(times_ns), np.bool_)
        return nowhere, nowhere
    place = np.searchsorted(evidence.start_ns, times_ns, "right") - 1
    held = (place >= 0) & (times_ns < evidence.end_ns[place])
    if evidence.holds_on:
        held |= (place == len(evidence.start_ns) - 1) & (times_ns <= evidence.until_ns)
    return held, held & evidence.is_open[place]


def _ends_look(evidence: DoorEvidence) -> NDArray[np.bool_]:
    """Return which sightings are the last of a look."""
    cell = evidence.seen_ns // PASS_NS
    certain = is_certain(np.clip(evidence.llr, -CERTAIN_LLR, CERTAIN_LLR))
    goes_on = (cell[1:] == cell[:-1]) & ~certain[1:] & ~certain[:-1]
    return np.append(~goes_on, True)[: len(cell)]


def _last_known(evidence: DoorEvidence) -> NDArray[np.bool_]:
    """Return the stretches after which the state is not known: their ends are looks, too.

    Where the next stretch begins at once, the change does not count as a look of its own: rates
    are those at the pace of looks.
    """
    goes_on = np.append(evidence.start_ns[1:] == evidence.end_ns[:-1], evidence.holds_on)
    return np.asarray(~goes_on[: len(evidence.end_ns)], np.bool_)


def _certain(is_open: NDArray[np.bool_]) -> NDArray[np.float64]:
    return np.where(is_open, CERTAIN_LLR, -CERTAIN_LLR)
