"""Write the events of several logs as one log, by the ordinary writer, as they were recorded.

The history of a join begins where those of all its logs have begun. Logs may disagree about a door
that they share; doors whose geometry is close are proposed as one. A log that was thinned keeps the
first and the last of sightings that repeat each other: if another log saw the door otherwise in
between, its state until the last of them is unknown.
"""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from heapq import merge
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.folds.registers import COMES, STATE_ROW, state_rows
from semmap_log.core.folds.renumbering import AFTER_ROBOT, BETWEEN_ROBOTS
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.commits import Commit, Note
from semmap_log.core.model.events import STATE_KINDS, Retracted, SightingsThinned
from semmap_log.errors import LogError
from semmap_log.fleet.join.door_plan import BuildingDoor, DoorPlan, LogDoor
from semmap_log.fleet.join.event_translation import EventTranslation
from semmap_log.fleet.join.joined_logs import DoorRow, JoinedLog, JoinedLogs
from semmap_log.log import FollowedCommit, LogInfo, RewrittenLog, Window, kinds_mask

ID_BYTES = 16
TOLD_EVERY = 1000
"""Commits between two reports of progress."""


class SeededBytes:
    """Ids and salts derived from what is joined: the same view has the same bytes."""

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
        plan: The building's doors.
        folder: The new log's folder; it must not exist.
        seed: The source of all ids and salts, including the log's own.
        names_origin: Each commit's reason names the log, event and head that it comes from.
        progress: Called with the number of events done.

    Raises:
        LogExistsError: Something is there.
        CorruptLogError: A log is damaged; the message names the file.
        NewerLogError: A log holds what only a later version understands.
    """
    for log in joined.logs:
        log.opened.retractions()  # raises what is raised below, before anything is written
    entropy, horizon_ns = SeededBytes(seed), horizon_of(joined, plan)
    made = RewrittenLog(folder, _info(joined, entropy), entropy, horizon_ns=horizon_ns)
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
        made: RewrittenLog,
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
                f"{log.name}{AFTER_ROBOT}{text}" if text else log.name
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
    """Yield the commits that a log had when it was opened, with their sort keys.

    Raises:
        LogError: A recorded time does not grow.
    """
    last_ns = -1
    for followed in log.opened.kept_commits():
        commit = followed.commit
        if commit.recorded_ns <= last_ns and commit.count:
            raise LogError(f"{log.place}: event {commit.first_event} was recorded out of order.")
        last_ns = commit.recorded_ns
        yield commit.recorded_ns, log.log_id, commit.first_event, log, followed


TOLERANCE_M = 0.3
"""Ends of one door that lie farther apart are a conflict."""
NEAR_M = 0.6
"""Doors whose ends lie nearer are proposed as one."""

Ends = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class DoorConflict:
    """What two logs say of one door; the later event counts, whichever log has it."""

    door: BuildingDoor
    what: str
    """`geometry`, `type`, `level` or `removed`."""
    says: tuple[str, str]
    """Log and value, of the one and of the other."""


@dataclass(frozen=True, slots=True)
class DoorProposal:
    """Two doors that lie at the same place."""

    first: LogDoor
    second: LogDoor
    apart_m: float
    """The largest distance of their ends."""

    def rows(self) -> Iterator[DoorRow]:
        """Yield the rows of a table that would make them one."""
        name = self.first.door.name or self.second.door.name
        called = name or f"{self.first.log}/{self.first.door_id}"
        for each in (self.first, self.second):
            yield DoorRow(each.log, f"id:{each.door_id}", called)


def door_conflicts(joined: JoinedLogs, plan: DoorPlan) -> list[DoorConflict]:
    """Return where logs differ about shared doors, by the doors' numbers."""
    return [
        DoorConflict(door, what, says)
        for door in plan.doors
        for one, other in combinations(sorted(door.doors, key=_key), 2)
        if one.log != other.log
        for what, says in _differing(joined, plan, one, other)
    ]


def _key(each: LogDoor) -> tuple[str, int]:
    return each.log, each.door_id


def _differing(
    joined: JoinedLogs, plan: DoorPlan, one: LogDoor, other: LogDoor
) -> Iterator[tuple[str, tuple[str, str]]]:
    logs = (one.log, other.log)

    def said(*values: object) -> tuple[str, str]:
        first, second = (f"{log}: {value}" for log, value in zip(logs, values, strict=True))
        return first, second

    if one.is_present != other.is_present:
        values = ("there" if each.is_present else "removed" for each in (one, other))
        yield "removed", said(*values)
    levels = [plan.levels.of(each.log, each.door.level) for each in (one, other)]
    if levels[0] != levels[1]:
        yield "level", said(*levels)
    types = [each.door.annotations.get("type") for each in (one, other)]
    if None not in types and types[0] != types[1]:
        yield "type", said(*types)
    ends = [_ends(joined, each) for each in (one, other)]
    if ends[0] and ends[1] and (apart := _apart(ends[0], ends[1])) > TOLERANCE_M:
        yield "geometry", said(*(f"{_told(each)}, {apart:.2f} m apart" for each in ends if each))


def _told(ends: Ends) -> str:
    return " to ".join(f"({x:.2f}, {y:.2f})" for x, y in ends)


def _ends(joined: JoinedLogs, each: LogDoor) -> Ends | None:
    """Return a door's ends in the building's frame; None: unknown there."""
    frame = next(log.frame for log in joined.logs if log.name == each.log)
    if frame is None or not each.door.is_placed:
        return None
    start, end = (frame.moved(x, y, 0.0)[:2] for x, y in (each.door.start, each.door.end))
    return (float(start[0]), float(start[1])), (float(end[0]), float(end[1]))


def _apart(one: Ends, other: Ends) -> float:
    """Return the largest distance of the ends, in whichever order fits better."""
    return min(max(math.dist(one[0], other[i]), math.dist(one[1], other[1 - i])) for i in (0, 1))


def propose_doors(joined: JoinedLogs, plan: DoorPlan) -> list[DoorProposal]:
    """Return doors of two logs at one place, nearest first; each door once for each pair of logs.

    Only doors that are there, not shared yet, and of logs in the building's frame.
    """
    free = [door.doors[0] for door in plan.unmatched if door.doors[0].is_present]
    found = sorted(
        _near(joined, plan, free), key=lambda p: (p.apart_m, _key(p.first), _key(p.second))
    )
    taken: set[tuple[tuple[str, int], str]] = set()
    chosen = []
    for proposal in found:
        keys = {
            (_key(proposal.first), proposal.second.log),
            (_key(proposal.second), proposal.first.log),
        }
        if not keys & taken:
            taken |= keys
            chosen.append(proposal)
    return chosen


def _near(joined: JoinedLogs, plan: DoorPlan, doors: Sequence[LogDoor]) -> Iterator[DoorProposal]:
    placed = [(each, ends) for each in sorted(doors, key=_key) if (ends := _ends(joined, each))]
    for (one, one_ends), (other, other_ends) in combinations(placed, 2):
        levels = {plan.levels.of(each.log, each.door.level) for each in (one, other)}
        apart = _apart(one_ends, other_ends)
        if one.log != other.log and len(levels) == 1 and apart <= NEAR_M:
            yield DoorProposal(one, other, apart)


def horizon_of(joined: JoinedLogs, plan: DoorPlan) -> int:
    """Return the moment (ns) from which on a join's history is complete; -1: always.

    It is that of the log that keeps least. It is later if a log disagrees with thinned sightings of
    another, or later retracts an event from before it: a state at the horizon cannot know both.
    """
    horizons_ns = (log.opened.horizon_ns() for log in joined.logs)
    horizon_ns = max(known_again_ns(joined, plan), *horizons_ns)
    if horizon_ns < 0:
        return -1
    spans = sorted(span for log in joined.logs for span in _retracted(log))
    for retracted_ns, first_ns in spans:
        if first_ns <= horizon_ns < retracted_ns:
            horizon_ns = retracted_ns
    return horizon_ns


def _retracted(log: JoinedLog) -> Iterator[tuple[int, int]]:
    """Yield for each retraction when it was recorded, and when the first event it reaches was.

    Retractions from before the log's own horizon are left out: they only reach events that are gone
    already.
    """
    window = Window(kinds=kinds_mask([Retracted]), first_event=log.opened.horizon() or None)
    for one in (recorded for batch in log.opened.batches_in(window) for recorded in batch):
        assert isinstance(one.event, Retracted)
        reached = Window(first_event=one.event.first_event, before_event=one.event.last_event + 1)
        for batch in log.opened.batches_in(reached):
            yield log.known_ns(one.number), log.known_ns(int(batch.number[0]))
            break


def known_again_ns(joined: JoinedLogs, plan: DoorPlan) -> int:
    """Return when the last of such sightings was recorded (ns); -1: there is no such conflict."""
    thinned = {log.name: runs for log in joined.logs if len(runs := _thinned(log, plan))}
    if not thinned or len(joined.logs) < 2:
        return -1
    rows = {log.name: _states_of(log, plan) for log in joined.logs}
    return max(
        (
            known_ns
            for name, runs in thinned.items()
            for known_ns in _known_again(runs, rows[name], _others(rows, name))
        ),
        default=-1,
    )


def _known_again(
    runs: NDArray[np.void], own: NDArray[np.void], others: NDArray[np.void]
) -> Iterator[int]:
    """Yield when the last sighting of each run with a conflict was recorded.

    Args:
        runs: What was thinned of a log.
        own: The states that it keeps, by door and time.
        others: Those of the other logs, by door and time.
    """
    for run in runs:
        mine, theirs = (_of_door(rows, run["door_id"]) for rows in (own, others))
        before = int(np.searchsorted(mine["folds_ns"], run["first_ns"], "right")) - 1
        start_ns = mine["folds_ns"][before] if before >= 0 else run["first_ns"]
        first, end = np.searchsorted(theirs["folds_ns"], [start_ns, run["last_ns"]])
        if (theirs["state"][first:end] != run["state"]).any():
            last = int(np.searchsorted(mine["folds_ns"], run["last_ns"], "right"))
            after = mine["recorded_ns"][last : last + 1]
            yield int(max(run["recorded_ns"] if not len(after) else after[0], run["last_ns"]))


def _of_door(rows: NDArray[np.void], door_id: int) -> NDArray[np.void]:
    first, end = np.searchsorted(rows["door_id"], [door_id, door_id + 1])
    return rows[first:end]


def _others(rows: dict[str, NDArray[np.void]], name: str) -> NDArray[np.void]:
    found = [each for other, each in rows.items() if other != name]
    return _sorted(np.concatenate(found))


def _states_of(log: JoinedLog, plan: DoorPlan) -> NDArray[np.void]:
    """Return the states of the building's doors in a log, by door and time."""
    opened = log.opened
    hidden = opened.retractions()
    window = Window(kinds=kinds_mask(STATE_KINDS), first_event=opened.horizon() or None)
    rows = state_rows(map(hidden.visible, opened.batches_in(window)))
    rows = rows[rows["state"] < COMES]
    return _sorted(_in_building(rows, log, plan))


def _thinned(log: JoinedLog, plan: DoorPlan) -> NDArray[np.void]:
    """Return what was thinned of a log, with the doors' numbers in the building."""
    opened = log.opened
    hidden, found = opened.retractions(), [np.empty(0, _RUN)]
    window = Window(kinds=kinds_mask([SightingsThinned]), first_event=opened.horizon() or None)
    for batch in opened.batches_in(window):
        told = hidden.visible(batch)
        if len(told):
            rows = np.zeros(len(told), _RUN)
            rows["recorded_ns"] = told.recorded_ns
            for name in ("door_id", "state", "first_ns", "last_ns"):
                rows[name] = told[SightingsThinned][name]
            found.append(rows)
    return _in_building(np.concatenate(found), log, plan)


def _in_building(rows: NDArray[np.void], log: JoinedLog, plan: DoorPlan) -> NDArray[np.void]:
    own, building = plan.ids[log.name]
    rows = rows[np.isin(rows["door_id"], own)]
    rows["door_id"] = building[np.searchsorted(own, rows["door_id"])]
    return rows


def _sorted(rows: NDArray[np.void]) -> NDArray[np.void]:
    assert rows.dtype == STATE_ROW
    return rows[np.lexsort((rows["number"], rows["folds_ns"], rows["door_id"]))]


_RUN: np.dtype[np.void] = np.dtype(
    [("door_id", "u4"), ("state", "u1"), ("first_ns", "i8"), ("last_ns", "i8"),
     ("recorded_ns", "i8")]
)  # fmt: skip
