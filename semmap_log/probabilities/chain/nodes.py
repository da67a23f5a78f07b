"""A door's evidence as a chain takes it: looks at certain times, and what each saw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semmap_log.common.late_dataclass import dataclass
from semmap_log.domain.moments import SECOND_NS
from semmap_log.probabilities.chain.markov_chain import Nodes
from semmap_log.probabilities.evidence.evidence import DoorEvidence
from semmap_log.probabilities.evidence.visits import MOST_ACCURACY
from semmap_log.probabilities.local_clock import HOUR_S, LocalClock

Times = NDArray[np.int64]

LOOK_NS = HOUR_S * SECOND_NS // 2
"""Where the state is known all through, a look each half hour tells it: the pace of a patrol."""
CERTAIN_LLR = float(np.log(MOST_ACCURACY / (1 - MOST_ACCURACY)))


@dataclass(frozen=True, slots=True)
class Looks:
    """When something was seen, and when the hour changes; ascending."""

    times_ns: Times
    """(n,)."""
    llr: NDArray[np.float64]
    """(n,): 0 where nothing was seen."""
    hour: NDArray[np.intp]
    """(n,): of the day, local."""

    def __len__(self) -> int:
        return len(self.times_ns)

    def nodes(self) -> Nodes:
        """Return them as one sequence, with a bin for each hour of the day."""
        gap_s = np.diff(self.times_ns, prepend=self.times_ns[:1]) / SECOND_NS
        return Nodes(gap_s, self.llr, self.hour, np.arange(len(self)) == 0)

    def only(self, chosen: NDArray[np.bool_]) -> Looks:
        """Return some of them."""
        return Looks(self.times_ns[chosen], self.llr[chosen], self.hour[chosen])


def training_set(evidence: DoorEvidence, clock: LocalClock, from_ns: int, until_ns: int) -> Looks:
    """Return the looks that rates are learnt from: of a visit one, its last.

    Args:
        evidence: Of the door.
        clock: Whose hours.
        from_ns: As `looks`.
        until_ns: As `looks`.
    """
    visits = np.bincount(evidence.visit, evidence.llr).astype(np.float64)
    last = np.zeros(len(visits), np.intp)
    last[evidence.visit] = np.arange(len(evidence.visit))
    order = np.argsort(last, kind="stable")
    visited = replace(evidence, seen_ns=evidence.seen_ns[last[order]], llr=visits[order])
    found = looks(visited, clock, from_ns, until_ns)
    changes_hour = np.append(True, np.diff(found.hour) != 0)[: len(found)]
    return found.only(changes_hour | (found.llr != 0))


def looks(evidence: DoorEvidence, clock: LocalClock, from_ns: int, until_ns: int) -> Looks:
    """Return the looks at a door from one time to another, both included.

    Args:
        evidence: Of the door.
        clock: Whose hours.
        from_ns: What was seen before is left out.
        until_ns: And what came after.
    """
    first, last = clock.hour_of(np.array([from_ns, until_ns], np.int64)).tolist()
    hours_ns = clock.hours(min(first, last), max(first, last) + 1).start_ns
    grid_ns = np.stack([hours_ns, hours_ns + LOOK_NS], axis=1).ravel()
    held, is_open = held_at(evidence, grid_ns)
    ends = _last_known(evidence)
    times_ns = np.concatenate([grid_ns, evidence.end_ns[ends], evidence.seen_ns])
    llr = np.concatenate(
        [
            np.where(held, _certain(is_open), 0.0),
            _certain(evidence.is_open[ends]),
            np.clip(evidence.llr, -CERTAIN_LLR, CERTAIN_LLR),
        ]
    )
    order = np.argsort(times_ns, kind="stable")
    times_ns, llr = times_ns[order], llr[order]
    inside = (times_ns >= from_ns) & (times_ns <= until_ns)
    hour = clock.hour_of(times_ns[inside]) % 24
    return Looks(times_ns[inside], llr[inside], hour.astype(np.intp))


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


def _last_known(evidence: DoorEvidence) -> NDArray[np.bool_]:
    """Return the stretches behind which the state is not known: their ends are looks, too.

    Where the next stretch begins at once the change is none: rates are those at the pace of looks.
    """
    goes_on = np.append(evidence.start_ns[1:] == evidence.end_ns[:-1], evidence.holds_on)
    return np.asarray(~goes_on[: len(evidence.end_ns)], np.bool_)


def _certain(is_open: NDArray[np.bool_]) -> NDArray[np.float64]:
    return np.where(is_open, CERTAIN_LLR, -CERTAIN_LLR)
