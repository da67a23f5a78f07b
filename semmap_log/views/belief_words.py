"""Format beliefs and the steps of a patrol round as text.

Numbers are short enough for a table, with the caveats that belong next to them. For a round under
way, a line after each event names the robot's next stop.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from semmap_log.analysis.beliefs.door_beliefs import EvidenceSummary
from semmap_log.analysis.probabilities.evidence.coverage import WEEK, spans_in_short
from semmap_log.core.folds.door_index import distinct_labels
from semmap_log.core.model.doors import Door
from semmap_log.core.model.moments import format_short
from semmap_log.core.texts import counted
from semmap_log.views.event_words import printable

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


def moment_text(ns: int, tz: str) -> str:
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
    labels = distinct_labels((each.door, each.level_name) for each in told)
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
