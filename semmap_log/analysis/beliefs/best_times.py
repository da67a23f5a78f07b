"""When to go: the hours in which a door is likeliest open, or closed; and how long to wait."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.beliefs import door_beliefs
from semmap_log.analysis.probabilities.estimator import StateModel
from semmap_log.analysis.probabilities.evidence.coverage import HOURS, WeekMask
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import Door, DoorId
from semmap_log.core.model.local_clock import HOUR_S
from semmap_log.core.model.moments import Time
from semmap_log.log import DoorLog

if TYPE_CHECKING:
    from semmap_log.analysis.probabilities.sensors.sensor_doubts import SensorDoubt

State = Literal["open", "closed"]

MOST_WINDOWS = 5
ABOUT_THE_SAME = 0.05
"""Hours whose probability is at most so far below the best count as equally good."""
WORTHLESS = 0.25
"""Hours that are further below the best of all are excluded."""


@dataclass(frozen=True, slots=True)
class LikelyHours:
    """Consecutive hours in which a door is likely in the state, with their mean probability."""

    start_ns: int
    """The next time that it begins; of one that is under way, now."""
    end_ns: int
    first_hour: int
    """Of the week, 0..167, from Monday's midnight on, local time."""
    hours: int
    probability: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class BestTime:
    """When a door is likeliest in a state."""

    state: State
    now: door_beliefs.DoorBelief
    """How likely it is open at the queried moment."""
    tz: str
    is_known: bool
    """False: too little was seen of the door; there are no windows."""
    of_the_week: list[LikelyHours]
    """In a typical week, the best first."""
    next_ones: list[LikelyHours]
    """From now on, with what was seen last; in order of time."""
    never_seen: WeekMask
    """Hours of the week of which nothing is known: no window lies in them."""
    wait_s: float | None
    """How long it takes on average until the door is in that state; None: that is unknown, or the
    estimator does not provide it."""
    wait_interval_s: tuple[float, float] | None
    """The ends of its 90 % interval, as what was seen leaves it open."""
    sensor_doubts: Sequence[SensorDoubt] = ()
    """Sensors that are not as accurate as declared: the numbers are off."""


def best_time(
    log: DoorLog,
    door: DoorId | str,
    state: State = "open",
    *,
    at: Time = None,
    known_at: Time = None,
    as_happened: bool = False,
    estimator: str | None = None,
    tz: str | None = None,
    most: int = MOST_WINDOWS,
    progress: Progress | None = None,
) -> BestTime:
    """Return when a door is likeliest in a state.

    Args:
        log: The log of the door.
        door: Id, name, or level/name.
        state: `open` or `closed`.
        at: The moment of the query, with all that is known today of what had happened by then.
        known_at: Only what had been recorded by then, whole commits; without `at` it is the moment,
            too. Without either that is the log's end.
        as_happened: As if each event had been recorded when it happened, even if it was imported or
            recorded later: see `door_beliefs.ask`.
        estimator: For the next hours; None: `filter`.
        tz: IANA zone of the building's clocks; None: the log's.
        most: How many windows of each kind.
        progress: Called with the progress of reading.

    Raises:
        UnknownDoorError: The door was not in the map then.
        EstimatorError: There is no such estimator.
        MomentError: The time or the zone cannot be read.
    """
    near = door_beliefs.ask(
        log,
        at=at,
        known_at=known_at,
        as_happened=as_happened,
        estimator=estimator or door_beliefs.default_estimator(),
        tz=tz,
        doors=[door],
        progress=progress,
    )
    (asked_for,) = near.doors
    week = door_beliefs.typical_week(near, asked_for)
    coming = _Coming.of(near, asked_for, week.is_seen)
    most = most if week.is_known else 0
    now = door_beliefs.belief(near, asked_for)
    wait = _wait_s(near, now, state) if week.is_known else None
    return BestTime(
        state=state,
        now=now,
        tz=near.clock.tz,
        is_known=week.is_known,
        of_the_week=coming.windows(week.hours.taken(np.divmod(coming.hours, HOURS)), state, most),
        next_ones=sorted(
            coming.windows(coming.said, state, most), key=lambda window: window.start_ns
        ),
        never_seen=~week.is_seen,
        wait_s=wait and wait[0],
        wait_interval_s=wait and wait[1],
        sensor_doubts=near.sensor_doubts(log),
    )


def _wait_s(
    asked: door_beliefs.BeliefQuery, now: door_beliefs.DoorBelief, state: State
) -> tuple[float, tuple[float, float]] | None:
    """Return the expected wait and its interval, if the estimator follows the door's state."""
    learnt = asked.beliefs.learnt(asked.known_ns)
    if not isinstance(learnt, StateModel) or not now.is_known:
        return None
    door_id, until_open = now.door.door_id, state == "open"
    seconds = learnt.wait_s(door_id, asked.known_ns, until_open=until_open)
    if not math.isfinite(seconds):
        return None
    return seconds, learnt.wait_interval_s(door_id, asked.known_ns, until_open=until_open)


@dataclass(frozen=True, slots=True)
class _Coming:
    """The week from a moment on, hour by hour; the first one is what is left of the hour."""

    hours: NDArray[np.int64]
    """(168,), of the week."""
    edges_ns: NDArray[np.int64]
    """(169,): when they begin, and the end of the last."""
    said: door_beliefs.WeekPattern
    """(168,): what is expected of them; known are those that were ever seen."""

    @classmethod
    def of(cls, asked: door_beliefs.BeliefQuery, door: Door, is_seen: WeekMask) -> _Coming:
        first = int(asked.clock.wall_s(np.array([asked.known_ns]))[0] // HOUR_S)
        counted = first + np.arange(door_beliefs.WEEK_HOURS + 1)
        edges_ns = asked.clock.instants_ns(counted.astype(np.float64) * HOUR_S)
        edges_ns[0] = asked.known_ns
        lengths_ns = np.diff(edges_ns)
        hours = counted[:-1] % door_beliefs.WEEK_HOURS
        forecast = asked.predict(door, edges_ns[:-1] + lengths_ns // 2)
        # In spring an hour is skipped: it takes no time.
        said = door_beliefs.WeekPattern.of(forecast, is_seen.ravel()[hours] & (lengths_ns > 0))
        return cls(hours, edges_ns, said)

    def windows(self, said: door_beliefs.WeekPattern, state: State, most: int) -> list[LikelyHours]:
        """Return the runs of hours with the highest probability of the state, the best first."""
        p, low, high = said.p_open, said.low, said.high
        if state == "closed":
            p, low, high = 1 - p, 1 - high, 1 - low
        return [
            LikelyHours(
                start_ns=int(self.edges_ns[run.start]),
                end_ns=int(self.edges_ns[run.stop]),
                first_hour=int(self.hours[run.start]),
                hours=run.stop - run.start,
                probability=float(p[run].mean()),
                low=float(low[run].mean()),
                high=float(high[run].mean()),
            )
            for run in best_runs(p, said.is_known, most)
        ]


def best_runs(
    probability: NDArray[np.float64], usable: NDArray[np.bool_], most: int
) -> list[slice]:
    """Return disjoint runs of cells, the best first; of cells about as good, the earlier first.

    A run extends as far as its cells are about as good.

    Args:
        probability: (n,), in order of time.
        usable: (n,), the cells that may belong to a run.
        most: How many.
    """
    free, runs = usable.copy(), list[slice]()
    if free.any():
        free &= probability >= probability[free].max() - WORTHLESS
    while len(runs) < most and free.any():
        good = free & (probability >= probability[free].max() - ABOUT_THE_SAME)
        edges = np.flatnonzero(np.diff(good, prepend=False, append=False))
        runs += [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
        free &= ~good
    return runs[:most]
