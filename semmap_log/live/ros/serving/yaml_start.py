"""The thesis's file of doors at the server's start: it fills a log, or agrees with it.

A log that the server does not write is only followed: its doors are offered, and no goal is taken.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

from semmap_log.core.folds.levels import only_doors
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import Door, DoorId, DoorMap
from semmap_log.core.model.events import DoorRemoved, Event, FloorMap, LogExported, Retracted
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import CommandError, SemmapError
from semmap_log.interop.formats.files.door_table import DoorTable, TableDoor
from semmap_log.interop.formats.files.thesis_yaml import read_thesis_yaml
from semmap_log.interop.importing import importing
from semmap_log.interop.importing.import_plan import differences
from semmap_log.live.ros.ros_node import Goal, Outcome
from semmap_log.live.ros.serving.door_server import RESULTS, SAVED_FORMAT
from semmap_log.log import DoorLog, DoorLogWriter, FollowedCommit, Scope

MOST_SAVES = 20
"""So many of the last files that were saved are compared."""


def start_with_yaml(
    log: DoorLogWriter,
    path: Path,
    *,
    replace: bool = False,
    level: str | None = None,
    default_prob: float | None = None,
) -> list[str]:
    """Bring a file of doors and a log together; return what there is to say of it.

    A log that never had doors is filled. Else the file must say what the log does, or be one that
    the log took in or saved itself: such a file has not changed, only the doors have since.

    Args:
        log: The log.
        path: The thesis's YAML.
        replace: Make the log's doors those of the file, in one commit.
        level: Number or name: where the file's new doors are; None: the only one.
        default_prob: What stands in files for a probability that the log does not have: one that
            was saved with it says what the log says.

    Raises:
        FormatError: The file cannot be read.
        CommandError: They differ; the message says where. Nothing is written.
    """
    table = read_thesis_yaml(path)
    if not log.state.used_door_ids:
        plan = importing.import_file(log, path, importing.ImportOptions(level=level)).plan
        left_out = (f"left out: {text}" for text in plan.left_out)
        return [*plan.summary, *left_out, *(f"warning: {text}" for text in plan.warnings)]
    found = list(_differing(table, log.door_map(), default_prob))
    if not found:
        return [f"{path}: {counted(len(table.doors), 'door')}, as in the log."]
    if replace:
        return _replace(log, table, found, level)
    if _is_known(log, table, level, default_prob):
        told = "the log has this file already and has gone on since, so the log counts"
        return [f"{path}: {told}. --yaml-replace takes the file's instead: {_shown(found)}"]
    export = command_line("export", log.path, "FILE.yaml")
    raise CommandError(
        f"{path} and the log differ: {_shown(found)}\nNothing was written. To take the file's "
        f"doors: --yaml-replace; to take the log's: {export} (what was written with "
        "--default-prob P is to be read with it, too)."
    )


def _differing(table: DoorTable, doors: DoorMap, default_prob: float | None) -> Iterator[str]:
    """Yield what differs, a line a door; doors without a place cannot be in such a file."""
    listed: dict[DoorId, TableDoor] = {}
    for door in table.doors:
        assert door.door_id is not None  # the format's keys
        listed[door.door_id] = door
        there = doors.doors.get(door.door_id)
        if there is None:
            yield f"line {door.line}: door {door.door_id}: in the file only"
            continue
        if not there.object_class.is_door:
            yield f"line {door.line}: door {door.door_id}: a {there.object_class.name} in the log"
            continue
        there = _with_default(there, default_prob)
        said = [f"{name} {_told(old)} in the log, {new} in the file"
                for name, old, new in differences(door, there)]  # fmt: skip
        if said:
            yield f"line {door.line}: door {door.door_id}: {', '.join(said)}"
    for door_id, there in only_doors(doors).doors.items():
        if there.is_placed and door_id not in listed:
            yield f"door {door_id}: in the log only"


def _told(value: object) -> object:
    return "not given" if isinstance(value, float) and math.isnan(value) else value


def _with_default(door: Door, default_prob: float | None) -> Door:
    """Return a door as a file has it that was written with a default."""
    if default_prob is None:
        return door
    return dataclasses.replace(
        door,
        prob_open=default_prob if math.isnan(door.prob_open) else door.prob_open,
        prob_closed=default_prob if math.isnan(door.prob_closed) else door.prob_closed,
    )


def _replace(
    log: DoorLogWriter, table: DoorTable, found: list[str], level: str | None
) -> list[str]:
    gone = [door for door in table.doors
            if door.door_id in log.state.used_door_ids
            and door.door_id not in log.door_map().doors
            and not log.state.removed_door(door.door_id)]  # fmt: skip
    if gone:
        raise CommandError(
            f"{table.path}:{gone[0].line}: the adding of door {gone[0].door_id} was taken back, "
            "and an id is never used twice; give the door another number in the file."
        )
    plan = importing.plan_thesis_yaml(
        log, table.path, importing.ImportOptions(level=level, update=True)
    )
    listed = {door.door_id for door in table.doors}
    removed: list[Event] = [
        DoorRemoved(door_id=door_id)
        for door_id, door in only_doors(log.door_map()).doors.items()
        if door.is_placed and door_id not in listed
    ]
    file_id = _replace_id(table.path)
    command_id = None if log.find_command(file_id) else file_id
    note = Note(source=table.path.name, reason="--yaml-replace")
    log.append([*removed, *plan.events], note=note, command_id=command_id)
    told = [f"{table.path}: the log's doors are the file's now: {_shown(found)}"]
    return [*told, *(text for text in plan.summary if "taken back" in text)]


def _is_known(
    log: DoorLogWriter, table: DoorTable, level: str | None, default_prob: float | None
) -> bool:
    """Return whether the log took the file in, as it is, or saved an equal one."""
    ids = (
        importing.command_id_of(table.path, importing.ImportOptions(level=level)),
        _replace_id(table.path),
    )
    if any(log.find_command(each) for each in ids):
        return True
    saved = [
        recorded.number
        for batch in log.batches(kinds=[LogExported])
        for recorded in batch
        if isinstance(recorded.event, LogExported) and recorded.event.format == SAVED_FORMAT
    ]
    return any(not list(_differing(table, log.replay(event=number), default_prob))
               for number in saved[-MOST_SAVES:])  # fmt: skip


def _replace_id(path: Path) -> bytes:
    """Return the id of the commit that made the log's doors those of a file."""
    return hashlib.sha256(b"--yaml-replace " + path.read_bytes()).digest()[:16]


def _shown(found: list[str]) -> str:
    more = [f"… and {len(found) - MOST_SHOWN} more"] if len(found) > MOST_SHOWN else []
    return "".join(f"\n  {text}" for text in (*found[:MOST_SHOWN], *more))


MOST_SHOWN = 20


POLL_S = 0.05

_ONLY_SHOWN = "this server only shows the log (--read-only). Nothing was done."


class DoorFollower:
    """What `DoorServer` is, of a log that is only read."""

    def __init__(
        self, path: Path, *, changed: Callable[[], None] = lambda: None, poll_s: float = POLL_S
    ) -> None:
        """Open the log, and follow it in a thread.

        Args:
            path: The log's folder.
            changed: Called when there is something new, and when following failed.
            poll_s: How often to look.

        Raises:
            NotALogError: There is none.
        """
        self._log = DoorLog(path)
        self._state = self._log.state_in()
        self._doors = self._state.door_map()
        self._changed = changed
        self._failure: SemmapError | OSError | None = None
        self._ending = threading.Event()
        commits = self._log.follow(self._state.event, poll_s=poll_s, stop=self._ending.is_set)
        self._thread = threading.Thread(
            target=self._follow, args=(commits,), name="follow", daemon=True
        )
        self._thread.start()

    def door_map(self) -> DoorMap:
        """Return the doors after the last commit that was seen.

        Raises:
            LogError: The log is damaged, or was exchanged.
        """
        if self._failure is not None:
            raise self._failure
        return self._doors

    @property
    def log(self) -> DoorLog:
        """The log with all that is written now."""
        self._log.refresh()
        return self._log

    def floor_of(self, doors: DoorMap, level: int) -> FloorMap | None:
        """Return the floor plan that a level has in one of its door maps; None: it has none."""
        return self.log.floor_of(doors, level)

    def run(self, goal: Goal) -> Outcome:
        """Refuse a goal."""
        name, nothing = RESULTS[goal.action]
        return Outcome(
            succeeded=False,
            result={name: nothing},
            text=f"{goal.action}: {_ONLY_SHOWN}",
        )

    def append(
        self,
        make: Callable[[DoorLogWriter], list[Event]],
        *,
        note: Note,
        command_id: bytes,
        content: bytes,
    ) -> int | None:
        """Refuse a command, of whatever client.

        Raises:
            CommandError: Always.
        """
        del make, note, command_id, content
        raise CommandError(_ONLY_SHOWN)

    def close(self) -> None:
        """Stop following."""
        self._ending.set()
        self._thread.join()

    def _follow(self, commits: Iterator[FollowedCommit]) -> None:
        try:
            for followed in commits:
                if Retracted in followed.batch:  # what it takes back is in the state
                    scope = Scope(event=followed.commit.last_event)
                    self._state = self._log.reopened_log().state_in(scope)
                else:
                    self._state.apply(followed.batch)
                self._doors = self._state.door_map()
                self._changed()
        except (SemmapError, OSError) as error:
            self._failure = error
            self._changed()
