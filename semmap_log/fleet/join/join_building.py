"""Writes the events of several logs as one, by the ordinary writer, as they were recorded."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from heapq import merge
from pathlib import Path

from semmap_log.core.io.progress import Progress
from semmap_log.core.model.commits import Commit, Note
from semmap_log.errors import LogError
from semmap_log.fleet.join.door_plan import DoorPlan
from semmap_log.fleet.join.event_translation import EventTranslation
from semmap_log.fleet.join.join_horizon import horizon_of
from semmap_log.fleet.join.joined_logs import JoinedLog, JoinedLogs
from semmap_log.log.door_log.robot_names import BEHIND_ROBOT, BETWEEN_ROBOTS
from semmap_log.log.replay.kept_commits import kept_commits
from semmap_log.log.rewriting.log_anew import LogAnew
from semmap_log.store.header import LogInfo
from semmap_log.store.reading.following import FollowedCommit

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
    entropy, horizon_ns = SeededBytes(seed), horizon_of(joined, plan)
    made = LogAnew(folder, _info(joined, entropy), entropy, horizon_ns=horizon_ns)
    rounds: dict[tuple[str, int], int] = {}
    translations = {
        log.name: EventTranslation(log, plan, rounds, horizon_ns) for log in joined.logs
    }
    try:
        building = _Building(made, translations, plan, names_origin=names_origin)
        building.write(joined, progress)
        made.finish()
    finally:
        made.close()
    left_out = {name: each.left_out for name, each in translations.items()}
    return BuiltJoin(made.next_event, left_out)


def _info(joined: JoinedLogs, entropy: SeededBytes) -> LogInfo:
    reference = joined.reference.opened.info
    robots = BETWEEN_ROBOTS.join(sorted(log.name for log in joined.logs))
    return LogInfo(
        entropy(ID_BYTES).hex(),
        reference.timezone,
        reference.building,
        robots,
        reference.holds,
    )


class _Building:
    """Appends one commit of the logs after the other."""

    def __init__(
        self,
        made: LogAnew,
        translations: Mapping[str, EventTranslation],
        plan: DoorPlan,
        *,
        names_origin: bool,
    ) -> None:
        self._made, self._translations, self._names_origin = made, translations, names_origin
        self._is_alone = plan.is_alone
        self._seen: set[bytes] = set()
        """Commands that are stored: a goal may have been given to two robots."""

    def write(self, joined: JoinedLogs, progress: Progress | None) -> None:
        total = sum(log.last_event + 1 for log in joined.logs)
        done = 0
        for place, (_, _, _, log, followed) in enumerate(
            merge(*map(_commits, joined.logs), key=lambda found: found[:3])
        ):
            self._append(log, followed)
            done += followed.commit.count
            if progress is not None and place % TOLD_EVERY == 0:
                progress(done, total)

    def _append(self, log: JoinedLog, followed: FollowedCommit) -> None:
        commit = followed.commit
        first, is_late = self._made.place(commit.recorded_ns)
        events = self._translations[log.name].translated(followed.batch, first, is_late=is_late)
        if events:
            note, command_id = self._note(log, commit), self._command(log, commit)
            self._made.append(events, commit, note=note, command_id=command_id)

    def _note(self, log: JoinedLog, commit: Commit) -> Note:
        note = commit.note
        actor, source = (
            (note.actor, note.source)
            if self._is_alone
            else (
                f"{log.name}{BEHIND_ROBOT}{text}" if text else log.name
                for text in (note.actor, note.source)
            )
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

    Raises:
        LogError: A recorded time does not grow.
    """
    last_ns = -1
    for followed in kept_commits(log.opened):
        commit = followed.commit
        if commit.recorded_ns <= last_ns and commit.count:
            raise LogError(f"{log.place}: event {commit.first_event} was recorded out of order.")
        last_ns = commit.recorded_ns
        yield commit.recorded_ns, log.log_id, commit.first_event, log, followed
