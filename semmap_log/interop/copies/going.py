"""What a rule takes out of a log, as far as copies of it are concerned."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field, replace

import numpy as np

from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model.events import DoorObserved, DoorPassed, LogExported
from semmap_log.interop.formats.kept_scans.reading import has_kept_scans
from semmap_log.log import (
    DoorLog,
    Notes,
    Redaction,
    Retention,
    Thinning,
    Tracks,
    TrimRule,
    Window,
    kinds_mask,
)

EVER = MAX_TIME_NS
"""Before this moment is everything."""


@dataclass(frozen=True, slots=True)
class Going:
    """What goes of a log; of it as it was before anything went."""

    log_id: str
    log_ids: AbstractSet[str]
    """With those of the logs that it was recovered from."""
    scans_before_ns: int = EVER
    """Visits that began before it show where the robot was, nanoseconds UTC; but for these:"""
    sightings: Mapping[int, Sequence[int]] = field(default_factory=dict)
    """Door -> when it was seen that early, as was recorded only later: by an import. Ascending."""
    removes_scans: bool = False
    """Whether their scans go."""
    names_scans: bool = False
    """Whether they are named."""
    actors: AbstractSet[str] | None = frozenset()
    """Whose notes go; None: all. Robots are among them."""
    saved_doors: bool = False
    """Whether states of doors go."""

    def shows(self, visit: Visit) -> bool:
        """Return whether a visit shows where the robot was when it went."""
        seen = self.sightings.get(visit.door_id, ())
        place = bisect_left(seen, visit.first_ns)
        is_later = place < len(seen) and seen[place] <= visit.last_ns
        return visit.first_ns < self.scans_before_ns and not is_later

    def names(self, robots: AbstractSet[str]) -> bool:
        """Return whether some of these robots are among the actors."""
        return bool(robots - {""} if self.actors is None else robots & self.actors)

    @classmethod
    def of(cls, rule: TrimRule, log: DoorLog) -> Going:
        """Return what a rule takes out of a log.

        Raises:
            CorruptLogError: The log is damaged.
        """
        log_id = log.info.log_id
        until_ns = _moment_of(log, rule.before) if rule.before else 0
        late = _sightings(log, rule.before, until_ns) if has_kept_scans(log.path) else {}
        going = cls(log_id, {log_id, *_recovered_from(log)}, until_ns, late)
        if isinstance(rule, Redaction):
            is_track = any(isinstance(part, Tracks) for part in rule.parts)
            actors = {part.actor for part in rule.parts if isinstance(part, Notes)}
            named = None if None in actors else {each for each in actors if each is not None}
            return replace(going, removes_scans=is_track, actors=named)
        is_retention = isinstance(rule, Retention)
        return replace(
            going,
            removes_scans=is_retention,
            names_scans=isinstance(rule, Thinning),
            saved_doors=is_retention,
        )


def _moment_of(log: DoorLog, event: int) -> int:
    """Return when the first commit was recorded that has that event, or a later one."""
    commit = next(log.commits(event), None)
    return EVER if commit is None else commit.recorded_ns


def _sightings(log: DoorLog, event: int, until_ns: int) -> dict[int, list[int]]:
    """Return when doors were seen before a moment, by events from a number on."""
    found = defaultdict[int, list[int]](list)
    window = Window(first_event=event, kinds=kinds_mask([DoorObserved, DoorPassed]))
    for batch in log.batches_in(window):
        early = np.flatnonzero(batch.folds_ns < until_ns)
        for door_id, at_ns in zip(
            batch.door_ids()[early].tolist(), batch.folds_ns[early].tolist(), strict=True
        ):
            found[door_id].append(at_ns)
    return {door_id: sorted(seen) for door_id, seen in found.items()}


def _recovered_from(log: DoorLog) -> set[str]:
    """Return the ids of the logs that `recover` made this one of."""
    window = Window(kinds=kinds_mask([LogExported]))
    told = (one.event for batch in log.batches_in(window) for one in batch)
    names = (event.file_name for event in told if isinstance(event, LogExported))
    return {match[1] for name in names if (match := re.search(r"\(([0-9a-f]{32})\)$", name))}
