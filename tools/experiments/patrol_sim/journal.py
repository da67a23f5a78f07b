"""The commits of a recording before they are written: what was recorded, when, by whom."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import semmap_log as sl
from semmap_log.core.model.commits import Note
from semmap_log.core.model.events import Event, Retracted

MS_NS = 1_000_000


@dataclass(frozen=True, slots=True)
class Entry:
    """A commit to be: its events are recorded together."""

    recorded_ns: int
    events: tuple[Event, ...]
    note: Note


class Journal(list[Entry]):
    """All commits of a recording, in any order until `settled`."""

    def add(self, recorded_ns: int, *events: Event, **note: str) -> None:
        """Record events at that moment; they happened then unless they say otherwise."""
        stamped = [
            event if event.happened_ns is not None else replace(event, happened_ns=recorded_ns)
            for event in events
        ]
        self.append(Entry(recorded_ns, tuple(stamped), Note(**note)))

    def settle(self) -> None:
        """Bring it into the order of recording, one commit a millisecond at most."""
        self.sort(key=lambda entry: entry.recorded_ns)
        for index, (before, entry) in enumerate(pairwise(list(self)), start=1):
            earliest = max(before.recorded_ns, self[index - 1].recorded_ns) + MS_NS
            if entry.recorded_ns < earliest:
                self[index] = replace(entry, recorded_ns=earliest)

    def hold_back(self, start_ns: int, end_ns: int, actor: str) -> None:
        """Record what the actor would have recorded from start to end only at the end."""
        for index, entry in enumerate(self):
            if entry.note.actor == actor and start_ns <= entry.recorded_ns < end_ns:
                self[index] = replace(entry, recorded_ns=end_ns)

    def find(self, wanted: Callable[[Event], bool]) -> tuple[int, int]:
        """Return the first such event of a settled journal as (place of its commit, number)."""
        number = 0
        for place, entry in enumerate(self):
            for event in entry.events:
                if wanted(event):
                    return place, number
                number += 1
        raise LookupError("no such event in the journal")

    def retract(self, recorded_ns: int, first_event: int, last_event: int, **note: str) -> None:
        """Take back events by number; the journal stays settled.

        Raises:
            ValueError: The retraction would be recorded before what it takes back, which would
                shift those numbers.
        """
        place = sum(entry.recorded_ns <= recorded_ns for entry in self)
        if sum(len(entry.events) for entry in self[:place]) <= last_event:
            raise ValueError(f"event {last_event} is not yet recorded at {recorded_ns}")
        retraction = Retracted(
            happened_ns=recorded_ns, first_event=first_event, last_event=last_event
        )
        self.insert(place, Entry(recorded_ns, (retraction,), Note(**note)))
        self.settle()


class SimulatedClock:
    """A clock that shows what it is told, for wall and monotonic time alike."""

    def __init__(self, start_ns: int, boot_id: bytes) -> None:
        self.now_ns = start_ns
        self.boot_id = boot_id
        self._booted_ns = start_ns - 3600 * 10**9

    def wall_ns(self) -> int:
        """Return the time it is in the simulation, UTC."""
        return self.now_ns

    def monotonic_ns(self) -> int:
        """Return how long the simulated machine has been up."""
        return self.now_ns - self._booted_ns


def write(
    path: Path, journal: Sequence[Entry], *, tz: str, robot: str, building: str,
    rng: random.Random, progress: Callable[[Sequence[Entry]], Iterable[Entry]],
) -> None:  # fmt: skip
    """Make a log of the journal: same journal and same `rng`, same bytes."""
    clock = SimulatedClock(journal[0].recorded_ns, rng.randbytes(16))
    log = sl.create(path, tz=tz, robot=robot, building=building, clock=clock, entropy=rng.randbytes)
    with log:
        for entry in progress(journal):
            clock.now_ns = entry.recorded_ns
            log.append(entry.events, note=entry.note, sync=False)
        log.sync()
