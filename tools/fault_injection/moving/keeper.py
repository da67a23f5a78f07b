"""A writer that notes what it was told, and whether it was told that something is wrong."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import semmap_log as sl
from fault_injection.acknowledged import Tell
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
