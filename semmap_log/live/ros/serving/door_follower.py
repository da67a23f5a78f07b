"""A log that another process writes, or nobody: its doors are offered, and no goal is taken."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import DoorMap
from semmap_log.core.model.events import Event, FloorMap, Retracted
from semmap_log.errors import CommandError, SemmapError
from semmap_log.live.ros.ros_node import Goal, Outcome
from semmap_log.live.ros.serving.door_server import RESULTS
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.door_log.door_log_writer import DoorLogWriter
from semmap_log.log.replay.replay import Scope
from semmap_log.store.reading.following import FollowedCommit

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
            changed: Told when there is something new, and when following failed.
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
                    self._state = self._log.opened_anew().state_in(scope)
                else:
                    self._state.apply(followed.batch)
                self._doors = self._state.door_map()
                self._changed()
        except (SemmapError, OSError) as error:
            self._failure = error
            self._changed()
