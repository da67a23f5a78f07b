"""What a caller knows of its log, and whether the log agrees, whatever befell the caller."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import semmap_log as sl
from fault_injection.fault import Outcome
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, RobotPose

Tell = Callable[[str, int, int], object]
"""Takes a word ("tried", "stored"), an event number and a door, and passes it on."""


@dataclass
class Ledger:
    """What a caller knows of its log: what it was told is stored, and what may be."""

    acknowledged: dict[int, int] = field(default_factory=dict)
    """Event number -> door."""
    tried: set[int] = field(default_factory=set)
    """Doors of which nobody said what became of them."""
    tell: Tell = lambda *_: None

    def add_doors(self, log: sl.DoorLogWriter, count: int = 1) -> None:
        """Add doors in one commit, and note the answer."""
        before = max([*self.acknowledged.values(), *self.tried], default=0)
        doors = [before + 1 + i for i in range(count)]
        for door in doors:
            self.note("tried", -1, door)
        added = [DoorAdded(door_id=DoorId(door)) for door in doors]
        first = log.append(added, note=Note(actor="me")).first_event
        for i, door in enumerate(doors):
            self.note("stored", first + i, door)

    def note(self, word: str, event: int, door: int) -> None:
        """Take down that a door is tried, or stored; and tell whoever wants to know."""
        self.tell(word, event, door)
        self.tried.add(door)
        if word == "stored":
            self.tried.discard(door)
            self.acknowledged[event] = door

    def outcome(self, path: Path, fault: str) -> Outcome:
        """Read the log, go on writing, read again, and return what came of it."""
        stored, problem = _stored(path)
        lost = sum(stored.get(number) != door for number, door in self.acknowledged.items())
        known = {*self.acknowledged.values(), *self.tried}
        invented = sum(door not in known for door in stored.values())
        if not problem:
            with sl.append(path, compact=False) as log:
                log.add_door()
            again, problem = _stored(path)
            if len(again) != len(stored) + 1 or not stored.items() <= again.items():
                problem = problem or "what was stored changed when the log was opened again"
        return Outcome(fault, len(self.acknowledged), lost, invented, problem)


def _stored(path: Path) -> tuple[dict[int, int], str]:
    """Return event number -> door, and what is wrong with the log."""
    log = sl.read(path)
    doors: dict[int, int] = {}
    poses: list[float] = []
    count = 0
    for batch in log.batches():
        for recorded in batch:
            event = recorded.event
            if recorded.number != count:
                return doors, f"expected event {count}, got {recorded.number}"
            count += 1
            if isinstance(event, DoorAdded):
                doors[recorded.number] = event.door_id
            elif isinstance(event, RobotPose):
                poses.append(event.x)
    if count != sum(commit.count for commit in log.commits()):
        return doors, f"{count} events are not those of the commits"
    if len(set(doors.values())) != len(doors):
        return doors, f"a door was added twice: {sorted(doors.values())}"
    if len(set(poses)) != len(poses):
        return doors, f"a pose is there twice: {poses}"
    return doors, ""
