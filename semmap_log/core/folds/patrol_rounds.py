"""The robot's patrol rounds: when each began and ended, whose and what it was."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.model.events import PatrolFinished, PatrolStarted

ROUND_KINDS = (PatrolStarted, PatrolFinished)


@dataclass(frozen=True, slots=True)
class Round:
    """One patrol round."""

    patrol: int
    """Its number."""
    start_ns: int | None
    """None: nobody told of its start."""
    end_ns: int | None
    """None: it goes on, or nobody told of its end."""
    actor: str
    """Who drove, by the note of its start, else of its end."""
    name: str
    """What it was for, from the same note."""

    @property
    def label(self) -> str:
        """What people call it."""
        return self.name or f"round {self.patrol}"

    def overlaps(self, since_ns: int, until_ns: int) -> bool:
        """Tell whether some of it lies between two times, as far as anybody knows."""
        begun = self.start_ns is None or self.start_ns < until_ns
        return begun and (self.end_ns is None or self.end_ns >= since_ns)


def rounds(entries: Iterable[HistoryEntry]) -> list[Round]:
    """Return the rounds, in the order in which they were first heard of.

    Of several starts or ends of one number the first counts; retracted ones do not.

    Args:
        entries: Of a history; other kinds than `ROUND_KINDS` are passed over.
    """
    found: dict[int, Round] = {}
    for entry in entries:
        event = entry.event
        if entry.retracted or not isinstance(event, ROUND_KINDS):
            continue
        known = found.get(event.patrol)
        here = known or Round(event.patrol, None, None, entry.actor, entry.reason)
        if isinstance(event, PatrolStarted) and here.start_ns is None:
            here = replace(here, start_ns=entry.folds_ns, actor=entry.actor, name=entry.reason)
        elif isinstance(event, PatrolFinished) and here.end_ns is None:
            here = replace(here, end_ns=entry.folds_ns)
        found[event.patrol] = here
    return list(found.values())
