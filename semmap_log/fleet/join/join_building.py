"""Writes the events of several logs as one, by the ordinary writer, as they were recorded."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from heapq import merge
from pathlib import Path

from semmap_log.domain.commits import Commit, Durability, Note
from semmap_log.door_log.robot_names import BEHIND_ROBOT, BETWEEN_ROBOTS
from semmap_log.errors import LogError
from semmap_log.fleet.join.door_plan import DoorPlan
from semmap_log.fleet.join.event_translation import EventTranslation
from semmap_log.fleet.join.join_horizon import horizon_of, state_before
from semmap_log.fleet.join.joined_logs import JoinedLog, JoinedLogs
from semmap_log.io.clock import KeptClock
from semmap_log.io.progress import Progress
from semmap_log.replay.written_state import WrittenState
from semmap_log.store.header import LogInfo
from semmap_log.store.reading.following import FollowedCommit, commits_after
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing.durability import DurabilityPolicy
from semmap_log.store.writing.writer import Environment, LogWriter
from semmap_log.store.writing.writer_opening import create_log
from semmap_log.trimming.retention import Retention
from semmap_log.trimming.trim_log import trim_log

ID_BYTES = 16
TOLD_EVERY = 1000
"""Commits between two words of progress."""


class SeededBytes:
    """Ids and salts that follow from what is joined: the same view has the same bytes."""

    def __init__(self, seed: bytes) -> None:
        self._seed = seed
        self._drawn = 0

    def __call__(self, count: int) -> bytes:
        """Return the next bytes, at most 32."""
        self._drawn += 1
        return hashlib.sha256(self._seed + self._drawn.to_bytes(8, "little")).digest()[:count]


@dataclass(frozen=True, slots=True)
class BuiltJoin:
    """How much was written."""

    events: int
    left_out: dict[str, Counter[str]]
    """Log -> kind -> events that do not count in the building."""


def build_join(
    joined: JoinedLogs,
    plan: DoorPlan,
    folder: Path,
    seed: bytes,
    *,
    names_origin: bool = False,
    progress: Progress | None = None,
) -> BuiltJoin:
    """Write a new log of the events of several, in the order of recording.

    Args:
        joined: The logs.
        plan: What their doors are in the building.
        folder: Where; nothing is there.
        seed: What ids and salts follow from, the log's own, too.
        names_origin: Each commit's reason names log, event and head that it comes from.
        progress: Told how many of the events are done.

    Raises:
        LogExistsError: Something is there.
        CorruptLogError: A log is damaged; the message names the file.
        NewerLogError: A log holds what only a later version understands.
    """
    for log in joined.logs:
        log.opened.check_known()
    entropy = SeededBytes(seed)
    policy = DurabilityPolicy(Durability.NONE)
    environment = Environment(policy, KeptClock(1), entropy, compacts=False)
    writer = create_log(folder, _info(joined, entropy), WrittenState, environment).writer
    building = _Building(writer, joined, plan, names_origin=names_origin)
    try:
        building.write(progress)
    finally:
        writer.close()
    if building.horizon_ns >= 0:
        rule = Retention(LogReader(folder), building.horizon_ns + 1)
        assert rule.horizon == building.horizon, "nothing behind it takes back what was before"
        _trim(folder, rule, writer.last_ns, entropy)
    left_out = {name: each.left_out for name, each in building.translations.items()}
    return BuiltJoin(writer.next_event, left_out)


def _trim(folder: Path, rule: Retention, last_ns: int, entropy: SeededBytes) -> None:
    """Give a join the horizon of its logs: before it not all of it is known."""
    trim_log(
        folder,
        rule,
        note=Note(reason="where history begins in one of its logs, it begins in a join"),
        writing={
            "durability": Durability.NONE,
            "compact": False,
            "clock": KeptClock(last_ns),
            "entropy": entropy,
        },
    )


def _info(joined: JoinedLogs, entropy: SeededBytes) -> LogInfo:
    reference = joined.reference.opened.info
    robots = BETWEEN_ROBOTS.join(sorted(log.name for log in joined.logs))
    return LogInfo(entropy(ID_BYTES).hex(), reference.timezone, reference.building, robots)


class _Building:
    """Appends one commit of the logs after the other."""

    def __init__(
        self, writer: LogWriter, joined: JoinedLogs, plan: DoorPlan, *, names_origin: bool
    ) -> None:
        self._writer, self._joined, self._names_origin = writer, joined, names_origin
        self._seen: set[bytes] = set()
        """Commands that are stored: a goal may have been given to two robots."""
        rounds: dict[tuple[str, int], int] = {}
        self.horizon_ns = horizon_of(joined)
        """Where its history begins; -1: it has no horizon …"""
        self.horizon = 0
        """… and the number of the first event there, once it has come."""
        self.translations = {
            log.name: EventTranslation(log, plan, rounds, self.horizon_ns) for log in joined.logs
        }

    def write(self, progress: Progress | None) -> None:
        total = sum(log.last_event + 1 for log in self._joined.logs)
        done, is_behind = 0, self.horizon_ns < 0
        for place, (_, _, _, log, followed) in enumerate(
            merge(*map(_commits, self._joined.logs), key=lambda found: found[:3])
        ):
            if not is_behind and followed.commit.recorded_ns > self.horizon_ns:
                is_behind = True
                self._begin_history()
            self._append(log, followed)
            done += followed.commit.count
            if progress is not None and place % TOLD_EVERY == 0:
                progress(done, total)

    def _begin_history(self) -> None:
        """Write the state at the horizon: a keyframe at the head of a segment."""
        self._writer.begin_segment(self.horizon_ns)
        self.horizon_ns, self.horizon = self._writer.last_ns, self._writer.next_event

    def _append(self, log: JoinedLog, followed: FollowedCommit) -> None:
        commit, writer = followed.commit, self._writer
        if writer.is_fresh:
            writer.begin_at(max(commit.recorded_ns - 1, 1))
        is_late = writer.last_ns >= commit.recorded_ns
        events = self.translations[log.name].translated(
            followed.batch, writer.next_event, is_late=is_late
        )
        if events:
            writer.append(
                events,
                note=self._note(log, commit),
                command_id=self._command(log, commit),
                content=commit.content,
                clock=KeptClock(commit.recorded_ns),
            )

    def _note(self, log: JoinedLog, commit: Commit) -> Note:
        note = commit.note
        actor, source = (
            f"{log.name}{BEHIND_ROBOT}{text}" if text else log.name
            for text in (note.actor, note.source)
        )
        reason = note.reason
        if self._names_origin:
            origin = f"log {log.log_id} event {commit.first_event} head {commit.hash.hex()}"
            reason = f"{reason}; {origin}" if reason else origin
        return replace(note, actor=actor, source=source, reason=reason, salt=b"")

    def _command(self, log: JoinedLog, commit: Commit) -> bytes:
        command_id = commit.command_id
        if command_id in self._seen:
            told = bytes.fromhex(log.log_id) + command_id + commit.hash
            command_id = hashlib.sha256(told).digest()[:ID_BYTES]
        self._seen.add(command_id)
        return command_id


Found = tuple[int, str, int, JoinedLog, FollowedCommit]


def _commits(log: JoinedLog) -> Iterator[Found]:
    """Yield the commits that a log had when it was opened, with what orders them.

    Where the log has a horizon, one more stands there for what it no longer keeps.

    Raises:
        LogError: A recorded time does not grow.
    """
    last_ns = -1
    left: list[int] | None = [] if log.opened.horizon else None
    for followed in commits_after(log.opened, -1):
        commit = followed.commit
        if left is not None:
            numbers = followed.batch.number
            left += numbers[numbers < log.opened.horizon].tolist()
            if commit.last_event >= log.opened.horizon:
                yield _ordered(log, state_before(log, followed, left))
                left = None
        if commit.recorded_ns <= last_ns:
            raise LogError(f"{log.place}: event {commit.first_event} was recorded out of order.")
        last_ns = commit.recorded_ns
        yield _ordered(log, followed)


def _ordered(log: JoinedLog, followed: FollowedCommit) -> Found:
    commit = followed.commit
    return commit.recorded_ns, log.log_id, commit.first_event, log, followed
