"""Format beliefs and the steps of a patrol round as text.

Numbers are short enough for a table, with the caveats that belong next to them. For a round under
way, a line after each event names the robot's next stop.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from semmap_log.analysis.beliefs.door_beliefs import EvidenceSummary
from semmap_log.analysis.planning.followed_round import FollowedRound, RoundStep
from semmap_log.analysis.planning.patrol_plan import PlannedStop
from semmap_log.analysis.probabilities.evidence.coverage import WEEK, spans_in_short
from semmap_log.core.model.doors import Door
from semmap_log.core.model.moments import format_local, format_short
from semmap_log.core.texts import counted
from semmap_log.log.door_log.summary import told_apart
from semmap_log.views.event_words import printable
from semmap_log.views.tables import ABSENT

STEP_ROW = (
    "event", "happened", "because", "target", "door_id", "door", "p", "low", "high", "arrives",
    "left", "why",
)  # fmt: skip
"""The columns of `step_row`, for programs."""
OVER = "the round is over"


def step_row(step: RoundStep, tz: str) -> tuple[str, ...]:
    """Return a step as the cells of `STEP_ROW`."""
    stop = step.stop
    first = (str(step.event), format_local(step.at_ns, tz), step.because)
    if stop is None:
        return (*first, *[ABSENT] * 7, str(step.left), OVER)
    numbers = (stop.p_passes, stop.low, stop.high)
    return (
        *first, stop.target.name, str(stop.door.door_id), stop.door.label,
        *(f"{each:.4f}" if stop.is_known else ABSENT for each in numbers),
        format_local(stop.arrives_ns, tz), str(step.left), stop.why,
    )  # fmt: skip


def step_line(step: RoundStep, tz: str) -> str:
    """Return a step in words: when, what was reported, where to go, P then, and why."""
    begun = f"{format_short(step.at_ns, tz)}  {printable(step.because)}"
    if step.stop is None:
        return f"{begun}. {OVER[0].upper()}{OVER[1:]}."
    return f"{begun}. Next: {_stop_in_words(step.stop, tz)}; {step.left} left"


def over_line(round_: FollowedRound) -> str:
    """Return what became of a round that is over."""
    left = [target.name for target in round_.not_visited]
    said = f"visited: {named([target.name for target in round_.visited]) or 'nothing'}"
    return f"{said}; not visited: {named(left)}" if left else said


def _stop_in_words(stop: PlannedStop, tz: str) -> str:
    chance = with_interval(stop.p_passes, stop.low, stop.high) if stop.is_known else "UNKNOWN"
    arrives = format_short(stop.arrives_ns, tz).rpartition(" ")[2]
    where = printable(stop.target.name)
    if stop.target.room is not None:
        where = f"{where} by {printable(stop.door.label)}"
    return f"{where} ({stop.door.door_id}) at {arrives}, P {chance}, {stop.why}"


MOST_GROUPS = 3
CARRIED_OVER = "what is said of an hour never seen is carried over from other hours"
MOST_NAMED = 6
"""So many doors are listed by name; `--json` has all."""


def short_number(probability: float) -> str:
    """Return a probability in two digits: `.83`; `<.01` and `>.99` at the ends."""
    if probability < 0.005:
        return "<.01"
    if probability >= 0.995:
        return ">.99"
    return f"{probability:.2f}"[1:]


def interval(low: float, high: float) -> str:
    """Return an interval as `.71-.92`; its ends may be 0 and 1."""
    return f"{_end(low)}-{_end(high)}"


def with_interval(probability: float, low: float, high: float) -> str:
    """Return a probability with its interval: `.83 (.71-.92)`; without, if they are the same."""
    said = short_number(probability)
    if short_number(low) == short_number(high):
        return said
    return f"{said} ({interval(low, high)})"


def _end(probability: float) -> str:
    return {"<.01": "0", ">.99": "1"}.get(said := short_number(probability), said)


def why_unknown(evidence: EvidenceSummary) -> str:
    """Return why there is no belief about a door."""
    if evidence.is_empty:
        return "never seen"
    said = f"{counted(evidence.counts.words, 'event')} about its state"
    return f"too little seen: {said}, {evidence.coverage.days:.1f} days"


def moment_in_words(ns: int, tz: str) -> str:
    """Return a moment as the building's clocks show it, to the second."""
    return format_short(ns, tz)


class BeliefTexts(Protocol):
    """A belief, or a typical week, of a door."""

    @property
    def door(self) -> Door:
        """The door."""

    @property
    def level_name(self) -> str:
        """Name of its level."""

    @property
    def evidence(self) -> EvidenceSummary:
        """What was seen of it."""


def labels_in(told: Sequence[BeliefTexts]) -> list[str]:
    """Return the doors' labels: level/name where several of them have the same name."""
    labels = told_apart((each.door, each.level_name) for each in told)
    return [labels.get(each.door.door_id, each.door.label) for each in told]


def never_seen_lines(told: Sequence[BeliefTexts]) -> list[str]:
    """Return the notes on hours in which nobody looked at the doors.

    For a few doors, or where doors are alike, one note each; otherwise only the hours in which none
    of the doors was ever seen.
    """
    alike: dict[bytes, list[str]] = {}
    for each, label in zip(told, labels_in(told), strict=True):
        if not each.evidence.is_empty:
            alike.setdefault(each.evidence.coverage.is_seen.tobytes(), []).append(label)
    gaps = {seen: ~np.frombuffer(seen, np.bool_).reshape(WEEK) for seen in alike}
    if len(alike) <= MOST_GROUPS:
        said = [f"never seen: {spans_in_short(gap)} ({named(alike[seen])})"
                for seen, gap in gaps.items() if gap.any()]  # fmt: skip
    else:
        nobody = np.logical_and.reduce(list(gaps.values()))
        said = [f"never seen: {spans_in_short(nobody)} (all these doors)"] * bool(nobody.any())
    return said


def named(labels: Sequence[str]) -> str:
    """Return the labels of some doors; of many, the first ones and the number of the others."""
    names = ", ".join(map(printable, labels[:MOST_NAMED]))
    more = len(labels) - MOST_NAMED
    return f"{names} and {more} more" if more > 0 else names
