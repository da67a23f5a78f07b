"""What a program was told of its annotations, line by line, and whether the log's bytes agree."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

Tell = Callable[[str], object]


def digest(text: str) -> str:
    """Return a few digits that stand for a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:12]


@dataclass
class Said:
    """What the threads of a run were told, and what they ran into."""

    tried: set[str] = field(default_factory=set)
    """Keys of annotations, whatever became of them."""
    accepted: dict[str, tuple[int, str]] = field(default_factory=dict)
    """Key -> event number and digest of the text: `append` returned."""
    durable: set[str] = field(default_factory=set)
    """Keys of those that survive a power cut, the log said."""
    poses: set[float] = field(default_factory=set)
    problems: list[str] = field(default_factory=list)
    snapshots: list[tuple[Path, frozenset[str]]] = field(default_factory=list)
    """Copies as a power cut would have left them, and what had been promised by then."""
    closed: bool = False
    """Whether `close` returned: then all that was accepted is there."""

    @classmethod
    def of(cls, lines: Iterable[str]) -> Said:
        """Read what a child told."""
        said = cls()
        for line in lines:
            word, *values = json.loads(line)
            said._take(word, values)
        return said

    def _take(self, word: str, values: list[Any]) -> None:
        if word == "tried":
            self.tried.add(values[0])
        elif word == "accepted":
            self.accepted[values[0]] = (values[1], values[2])
        elif word == "durable":
            self.durable.add(values[0])
        elif word == "pose":
            self.poses.add(values[0])
        elif word == "snapshot":
            self.snapshots.append((Path(values[0]), frozenset(self.durable)))
        elif word == "closed":
            self.closed = True
        else:
            self.problems.append(f"{word}: {' '.join(map(str, values))}")


def lost_and_invented(
    said: Said, found: dict[str, Any], promised: Iterable[str]
) -> tuple[int, int, str]:
    """Return how many promised annotations are not there as told, how many nobody made, and more.

    Args:
        said: What the program was told.
        found: What the oracle found.
        promised: The keys that must be there.
    """
    stored = [event for event in found["events"] if event["kind"] == "DoorAnnotated"]
    there = {e["key"]: (e["event"], digest(e["value"])) for e in stored}
    lost = [key for key in promised if there.get(key) != said.accepted[key]]
    invented = [key for key in there if key not in said.tried]
    problems = [f"the oracle: {problem}" for problem in found["problems"]]
    if len(there) != len(stored):
        problems.append("an annotation is there twice")
    if [e["event"] for e in found["events"]] != list(range(len(found["events"]))):
        problems.append("event numbers with gaps")
    problems += [f"out of order: {one}" for one in _out_of_order(stored)]
    if lost:
        problems.append(f"lost or changed: {', '.join(sorted(lost)[:5])}")
    return len(lost), len(invented), "; ".join(problems)


def _out_of_order(stored: list[dict[str, Any]]) -> list[str]:
    """Return the keys that stand behind a later one of the same thread: `thread/number`."""
    last: dict[str, int] = {}
    wrong = []
    for event in stored:
        thread, number = event["key"].split("/")
        if int(number) <= last.get(thread, -1):
            wrong.append(event["key"])
        last[thread] = int(number)
    return wrong
