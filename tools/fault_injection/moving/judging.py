"""What is left of logs whose folders were moved about: found again by their ids, wherever."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fault_injection.moving.keeper import contents_of
from fault_injection.oracle_client import Oracle


@dataclass
class Kept:
    """What one writer was told."""

    log_id: str = ""
    path: str = ""
    stored: dict[int, float] = field(default_factory=dict)
    told: str = ""
    """The error it got; empty: none."""
    is_closed: bool = False


@dataclass
class Story:
    """What a scenario's writers were told, and what must not have changed."""

    keepers: dict[int, Kept] = field(default_factory=dict)
    bystanders: list[tuple[Path, dict[str, Any]]] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    steps: list[str] = field(default_factory=list)
    """What was done, in words."""

    @classmethod
    def of(cls, lines: Iterable[str]) -> Story:
        """Read what a child told."""
        story = cls()
        for line in lines:
            word, *values = json.loads(line)
            if word == "wrong":
                story.problems.append(" ".join(map(str, values)))
            elif word == "bystander":
                story.bystanders.append((Path(values[0]), values[1]))
            elif word == "step":
                story.steps.append(f"({' '.join(map(str, values))})")
            else:
                story._take(word, values)
        return story

    def _take(self, word: str, values: list[Any]) -> None:
        kept = self.keepers.setdefault(values[0], Kept())
        if word == "opened":
            kept.log_id, kept.path = values[1], values[2]
        elif word == "stored":
            kept.stored[values[1]] = values[2]
        elif word == "told":
            kept.told = values[1]
        elif word == "closed":
            kept.is_closed = True


def judge(story: Story, root: Path, oracle: Oracle) -> tuple[int, list[str]]:
    """Return how many stored events are nowhere any more, and all that is wrong.

    A writer that was told of an error knows; one that was not must find its log whole somewhere.
    """
    problems = list(story.problems)
    for path, before in story.bystanders:
        after = contents_of(path)
        changed = [n for n in sorted(before.keys() | after.keys()) if before.get(n) != after.get(n)]
        problems += [
            f"{name} was changed: {before.get(name, 'nothing')} is now {after.get(name, 'nothing')}"
            for name in changed
        ]
        if path.suffix == ".mcap" and path.is_file() and not changed:
            path.unlink()  # no part of the log beside it, and no fault of its writer
    logs = _logs_in(root, oracle)
    lost = 0
    for name, kept in story.keepers.items():
        if kept.told or not kept.log_id:
            continue
        gone, why = _looked_for(kept, logs)
        lost += gone
        if gone or why:
            problems.append(
                f"writer {name} of {Path(kept.path).name}: {gone} of {len(kept.stored)} gone, "
                f"{'closed without an error' if kept.is_closed else 'no error'}; {why}"
            )
    return lost, problems


def _logs_in(root: Path, oracle: Oracle) -> list[dict[str, Any]]:
    folders = sorted({path.parent for path in root.rglob("*.mcap") if path.is_file()})
    return [{**oracle.ask(folder), "folder": folder} for folder in folders]


def _looked_for(kept: Kept, logs: list[dict[str, Any]]) -> tuple[int, str]:
    """Return how many events are missing where most of them are, and what is wrong there."""
    best, why = len(kept.stored), "its log is nowhere"
    is_first = True
    for found in logs:
        if not any(segment["log_id"] == kept.log_id for segment in found["segments"]):
            continue
        there = {e["event"]: e["x"] for e in found["events"] if e["kind"] == "RobotPose"}
        gone = sum(there.get(number) != value for number, value in kept.stored.items())
        said = "; ".join(found["problems"])
        if is_first or (gone, bool(said)) < (best, bool(why)):
            best, why, is_first = gone, said, False
    return best, why
