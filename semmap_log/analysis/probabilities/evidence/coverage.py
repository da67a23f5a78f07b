"""When a door was looked at: the hours of the week that were seen, and those that never were.

A patrol by day shows nothing of the night, and a reader of a probability must know that.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.core.batches.event_batch import distinct, numbers_of
from semmap_log.core.model.local_clock import HOUR_S, LocalClock
from semmap_log.core.texts import counted

DAYS, HOURS = 7, 24
WEEK = (DAYS, HOURS)
DAY_NAMES = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")

WeekMask = NDArray[np.bool_]
"""(7, 24): local day of the week, Monday first, and hour of the day."""


@dataclass(frozen=True, slots=True)
class Coverage:
    """Which hours of the week a door was seen in, and how often."""

    times_seen: NDArray[np.int64]
    """(7, 24): on how many dates its state was known, or it was sighted, in that hour."""

    @classmethod
    def of(cls, evidence: DoorEvidence, clock: LocalClock) -> Coverage:
        """Return where the evidence lies on the building's clocks."""
        hours = distinct(_hours(evidence, clock)) % (DAYS * HOURS)
        return cls(np.bincount(hours, minlength=DAYS * HOURS).reshape(WEEK))

    @property
    def is_seen(self) -> WeekMask:
        """Where it was seen at all."""
        return self.times_seen > 0

    @property
    def hours_never_seen(self) -> int:
        """How many of the 168 hours of the week it was never seen in."""
        return int(np.count_nonzero(~self.is_seen))

    @property
    def days(self) -> float:
        """Effective days: the hours in which it was seen, 24 of them a day."""
        return float(self.times_seen.sum()) / HOURS


def _hours(evidence: DoorEvidence, clock: LocalClock) -> NDArray[np.int64]:
    """Return the local hours, counted from a Monday's midnight, in which something was known."""
    tells = evidence.accuracy_open + evidence.accuracy_closed > 1  # more than a coin does
    first, seen = (_hour(clock.wall_s(at)) for at in (evidence.start_ns, evidence.seen_ns[tells]))
    end = -_hour(-clock.wall_s(evidence.end_ns))  # an hour of which nothing is left is not touched
    return np.concatenate([numbers_of(first, np.maximum(end - first, 1)), seen])


def _hour(wall_s: NDArray[np.float64]) -> NDArray[np.int64]:
    return (wall_s // HOUR_S).astype(np.int64)


def spans_text(hours: WeekMask) -> list[str]:
    """Return hours of the week as people say them: `Sat, Sun`, `22:00-06:00`, `Mon 14:00-16:00`.

    Whole days first, then what is common to all other days, then the rest, day by day.
    """
    said, rest = _regular(hours)
    alike: dict[bytes, list[int]] = {}
    for day in np.flatnonzero(rest.any(axis=1)).tolist():
        alike.setdefault(rest[day].tobytes(), []).append(day)
    for days in alike.values():
        said.append(f"{_days(days)} {', '.join(map(_clock, _runs(rest[days[0]])))}")
    return said


def spans_in_short(hours: WeekMask) -> str:
    """Return hours of the week in a few words: whole days, hours common to the others, the rest.

    Such as `Sat, Sun; 22:00-06:00; 5 more hours of the week`.
    """
    said, rest = _regular(hours)
    if more := int(np.count_nonzero(rest)):
        said.append(f"{counted(more, 'more hour' if said else 'hour')} of the week")
    return "; ".join(said)


def _regular(hours: WeekMask) -> tuple[list[str], WeekMask]:
    """Return whole days and the hours common to all others, in words; and the hours left."""
    if hours.all():
        return ["at any hour"], np.zeros(WEEK, np.bool_)
    whole = np.asarray(hours.all(axis=1))
    common = np.asarray(hours[~whole].all(axis=0))
    said = [_days(np.flatnonzero(whole))] if whole.any() else []
    said += map(_clock, _over_midnight(_runs(common)))
    return said, hours & ~whole[:, None] & ~common


def _days(days: Iterable[int]) -> str:
    """Return days as `Mon-Fri`, or `Sat, Sun`."""
    parts: list[list[int]] = []
    for day in days:
        if parts and parts[-1][-1] == day - 1:
            parts[-1].append(day)
        else:
            parts.append([day])
    return ", ".join(
        f"{DAY_NAMES[part[0]]}-{DAY_NAMES[part[-1]]}"
        if len(part) > 2
        else ", ".join(DAY_NAMES[day] for day in part)
        for part in parts
    )


def _runs(hours: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the runs of hours of a day as (first, hour after the last)."""
    edges = np.flatnonzero(np.diff(hours, prepend=False, append=False)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _over_midnight(runs: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Join the run up to midnight, if there is one, with the one after it: every night."""
    if len(runs) > 1 and (runs[0][0], runs[-1][1]) == (0, HOURS):
        return [*runs[1:-1], (runs[-1][0], runs[0][1])]
    return runs


def _clock(span: tuple[int, int]) -> str:
    return f"{span[0]:02}:00-{span[1]:02}:00"
