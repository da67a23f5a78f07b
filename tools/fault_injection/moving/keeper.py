"""A writer that notes what it was told, and whether its log is found again, wherever."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import semmap_log as sl
from fault_injection.acknowledged import Tell
from fault_injection.oracle_client import Oracle
from semmap_log.core.model.events import RobotPose
from semmap_log.errors import SemmapError
from semmap_log.log.door_log.door_log_writer import DoorLogWriter


@dataclass
class Box:
    """A folder to play in, with a file and a folder outside of all logs that must stay."""

    folder: Path
    dice: random.Random
    tell: Tell
    _names: Any = field(default_factory=count)

    def say(self, word: str, *values: object) -> None:
        """Note something."""
        self.tell(json.dumps([word, *values]))

    def bystander(self, path: Path) -> None:
        """Note a file or folder that nobody may change from now on."""
        self.say("bystander", str(path), contents_of(path))

    def keeper(self, path: Path, **options: Any) -> Keeper:
        """Return a writer of a new log, or of one that is there."""
        return Keeper(self, next(self._names), path, **options)


def contents_of(path: Path) -> dict[str, list[Any]]:
    """Return what may not change: name -> inode, length and digest of each file, links' targets."""
    import hashlib

    found: dict[str, list[Any]] = {}
    paths = [path] if not path.is_dir() else sorted(path.rglob("*"))
    for one in paths:
        if one.is_symlink():
            found[str(one)] = ["link", str(one.readlink())]
        elif one.is_file():
            status = one.stat()
            digest = hashlib.sha256(one.read_bytes()).hexdigest()[:16]
            found[str(one)] = [status.st_ino, status.st_size, oct(status.st_mode), digest]
        else:
            found[str(one)] = ["other"]
    return found


class Keeper:
    """A writer of poses, each of its own: who finds one knows who wrote it, and when."""

    def __init__(
        self, box: Box, name: int, path: Path, *, durability: str = "event", compact: bool = False
    ) -> None:
        self._box = box
        self._numbers = count()
        self.name = name
        self.path = path
        self.is_over = False
        """It was told that something is wrong, or that the log is closed."""
        self.log: DoorLogWriter | None = None
        options: dict[str, Any] = {"durability": durability, "compact": compact}
        is_new = not any(path.glob("*.mcap"))
        make: Callable[..., DoorLogWriter] = sl.create if is_new else sl.append
        options |= {"tz": "UTC"} if is_new else {}
        self._guarded(lambda: self._open(make, options))

    def _open(self, make: Callable[..., DoorLogWriter], options: dict[str, Any]) -> None:
        self.log = make(self.path, **options)
        self._box.say("opened", self.name, self.log.info.log_id, str(self.path))

    def add(self, commits: int = 1) -> None:
        """Append, and note what was answered; durable, whatever the level."""
        for _ in range(commits):
            self._guarded(self._add_one)

    def _add_one(self) -> None:
        assert self.log is not None
        value = float(self.name * 1_000_000 + next(self._numbers))
        appended = self.log.append([RobotPose(x=value, y=0.0, theta=0.0)])
        appended.wait()
        self._box.say("stored", self.name, appended.first_event, value)

    def close(self) -> None:
        """Close, and note whether that was a success."""
        self._guarded(self._close)

    def _close(self) -> None:
        assert self.log is not None
        self.log.close()
        self._box.say("closed", self.name)
        self.is_over = True

    def _guarded(self, call: Callable[[], object]) -> None:
        if self.is_over:
            return
        try:
            call()
        except SemmapError as error:
            self.is_over = True
            self._box.say("told", self.name, f"{type(error).__name__}: {error}")
            with suppress(SemmapError):
                if self.log is not None:
                    self.log.close()
        except Exception as error:  # noqa: BLE001 - whatever it is, it is the finding
            self.is_over = True
            self._box.say("wrong", f"writer {self.name}: {error!r}")


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
