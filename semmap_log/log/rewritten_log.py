"""Writes the commits of a log, or of several, as a new one.

The ordinary writer makes it, at the times of their recording. The caller decides what becomes of
an event: `fleet.join`, `pseudonyms`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.renumbering import NextPlace, begins_ns
from semmap_log.core.io.clock import KeptClock
from semmap_log.core.model.commits import Commit, Durability, Note
from semmap_log.core.model.events import RobotPose
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.replay.written_state import WrittenState
from semmap_log.log.trimming.trim_log import Retention, trim_log
from semmap_log.store.folder import LogFolder
from semmap_log.store.header import LogInfo
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing.durability import DurabilityPolicy
from semmap_log.store.writing.writer import Environment
from semmap_log.store.writing.writer_opening import create_log


class RewrittenLog:
    """A log that is filled from its beginning, in the order in which all of it was recorded."""

    def __init__(
        self,
        folder: Path,
        info: LogInfo,
        entropy: Callable[[int], bytes],
        *,
        horizon_ns: int = -1,
    ) -> None:
        """Create the log.

        Args:
            folder: Its folder; nothing exists there yet.
            info: Its fixed properties.
            entropy: Where ids and salts come from.
            horizon_ns: What was recorded by this moment is not all known: history begins after
                it; -1: it has no horizon.

        Raises:
            LogExistsError: Something is there.
        """
        policy = DurabilityPolicy(Durability.NONE)
        environment = Environment(policy, KeptClock(1), entropy, compacts=False)
        self._folder, self._entropy = folder, entropy
        self._writer = create_log(folder, info, WrittenState, environment).writer
        self._horizon_ns, self._horizon = horizon_ns, -1

    @property
    def next_event(self) -> int:
        """Number of the event that comes next."""
        return self._writer.next_event

    def place(self, recorded_ns: int) -> NextPlace:
        """Return where the next commit comes, which was recorded then."""
        if self._writer.is_fresh:
            self._writer.begin_at(max(recorded_ns - 1, 1))
        if self._horizon < 0 <= self._horizon_ns < recorded_ns:
            self._begin_history()
        return NextPlace(self._writer.next_event, self._writer.last_ns >= recorded_ns)

    def append(self, events: list[Any], commit: Commit, *, note: Note, command_id: bytes) -> None:
        """Append a rewritten commit; `place` was queried before.

        Args:
            events: At least one, or a batch of them.
            commit: As it was.
            note: Its note now.
            command_id: Its id now.
        """
        self._writer.append(
            events,
            note=note,
            command_id=command_id,
            content=commit.content,
            clock=KeptClock(_begins_ns(events, commit)),
        )

    def _begin_history(self) -> None:
        """Write the state at the horizon: a keyframe at the head of a segment."""
        if self._writer.last_ns < self._horizon_ns - 1:
            # Nothing is kept of the last commit before it; a pose, which goes, stands for its time.
            clock = KeptClock(self._horizon_ns - 1)
            pose = RobotPose(x=0.0, y=0.0, theta=0.0)
            self._writer.append([pose], clock=clock)
        self._writer.begin_segment(self._horizon_ns)
        self._horizon_ns, self._horizon = self._writer.last_ns, self._writer.next_event

    def close(self) -> None:
        """Close it as it is."""
        self._writer.close()

    def read(self, shown: Path) -> DoorLog:
        """Open it for reading, once it is finished; messages show that path in place of its own."""
        folder = LogFolder(self._folder)
        folder.path = shown
        return DoorLog(folder)

    def finish(self) -> None:
        """Close it, and leave out what was before its horizon, if it has one."""
        if self._horizon < 0 <= self._horizon_ns:
            self._begin_history()
        self.close()
        if self._horizon_ns < 0:
            return
        until_ns = self._horizon_ns + 1
        rule = Retention(LogReader(self._folder), until_ns, always_has_horizon=True)
        assert rule.horizon == self._horizon, "nothing behind it takes back what was before"
        trim_log(
            self._folder,
            rule,
            note=Note(reason="history begins where it does in what this was made of"),
            writing={
                "durability": Durability.NONE,
                "compact": False,
                "clock": KeptClock(self._writer.last_ns),
                "entropy": self._entropy,
            },
        )


def _begins_ns(events: list[Any], commit: Commit) -> int:
    """Return when a rewritten commit is recorded."""
    if len(events) >= commit.count:  # nothing of it is lost, as of most commits
        return commit.recorded_ns
    times = [
        each.happened_ns if isinstance(each, EventBatch) else [each.happened_ns] for each in events
    ]
    happened_ns = np.concatenate(times)
    needed_ns = int((happened_ns - np.arange(len(happened_ns))).max())
    return begins_ns(commit.recorded_ns, commit.count - len(happened_ns), needed_ns)
