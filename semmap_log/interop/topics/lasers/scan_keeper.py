"""What a recorder or an import does with scans: visits to doors, and the commits they become.

Scans that come together are matched together. The scans of visits that ended are kept, with the
door's line as it was. What became of scans and visits, and what is odd about them, is reported in
words, for an import, a dry run, or the end of a recording.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Protocol

import numpy as np

from semmap_log.analysis.scans.door_figures import DoorFigures, door_warnings
from semmap_log.analysis.scans.door_watcher import DoorWatcher
from semmap_log.analysis.scans.visit import (
    DoorLine,
    DoorPlaces,
    PlacedScan,
    RecentScans,
    Visit,
    visit_key,
)
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import Door, DoorId, DoorState
from semmap_log.core.model.events import DoorObserved, DoorPassed, Event, RobotPose
from semmap_log.core.model.moments import format_local
from semmap_log.core.texts import counted
from semmap_log.errors import OutputError
from semmap_log.interop.formats.kept_scans.writing import KeptScansWriter
from semmap_log.interop.topics.lasers.door_places import DoorsNow
from semmap_log.interop.topics.lasers.lasers import Lasers, RobotScan
from semmap_log.interop.topics.lasers.placing import REACH_M
from semmap_log.interop.topics.topic_reader import Known

QUIET_S = 30.0
"""Of the clock on the wall: the visits of a robot end whose lasers are silent for so long."""


class ScanWatch:
    """Looks at the doors that are known, as they are."""

    def __init__(
        self,
        known: Known,
        robot: str,
        keeper: ScanKeeper | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._known = known
        self._doors = DoorsNow(known)
        self._sightings = LaserSightings(self._doors, robot, keeper=keeper)
        self._waiting: list[RobotScan] = []
        self._clock = clock
        self._received_s: dict[str, float] = {}
        """Robot whose visits may be going on -> when its last scan came."""

    def add(self, scans: Sequence[RobotScan]) -> None:
        """Have scans wait for `take`."""
        self._waiting += scans
        for each in scans:
            self._received_s[each.scan.robot] = self._clock()

    def take(self) -> Iterator[VisitCommit]:
        """Look through the scans that wait; yield the visits that ended.

        Those of a robot that is silent end, too: a sighting does not wait for the next scan, which
        may come in an hour, or never.
        """
        if self._waiting:
            scans, self._waiting = self._waiting, []
            yield from self._sightings.take(scans)
        since_s = self._clock() - QUIET_S
        for robot in [
            robot for robot, received_s in self._received_s.items() if received_s <= since_s
        ]:
            del self._received_s[robot]
            yield from self._sightings.end(robot)

    def close(self) -> Iterator[VisitCommit]:
        """The same, and all visits end."""
        yield from self.take()
        yield from self._sightings.close()

    def saw(self, events: Iterable[Event]) -> None:
        """Take note of events that are known by now."""
        self._doors.saw(events)

    def reset_known(self, known: Known) -> None:
        """Take other knowledge for what is known."""
        self._known = known
        self._doors = self._sightings.doors = DoorsNow(known)

    @property
    def visits(self) -> int:
        """How many visits there were."""
        tally = self._sightings.tally
        return tally.visits.total() + tally.passages + tally.again

    def lines(self, lasers: Lasers) -> Iterator[str]:
        """Yield what there was of scans and visits, and what is odd about it."""
        yield from counts_of(lasers, self._sightings)
        yield from oddities_of(lasers, self._sightings, lambda ns: format_local(ns, "UTC"))
        yield from door_oddities_of(self._sightings, self._known)


def counts_of(lasers: Lasers, sightings: LaserSightings) -> Iterator[str]:
    """Yield how many scans and visits there were."""
    for topic, counts in lasers.counts.items():
        dropped = f", {counts.dropped:,} dropped (the warnings say why)" if counts.dropped else ""
        yield f"scans of {topic}: {counts.received:,}, {counts.placed:,} on the map{dropped}"
    yield from sightings.tally.summary()


def oddities_of(
    lasers: Lasers, sightings: LaserSightings, when: Callable[[int], str]
) -> Iterator[str]:
    """Yield warnings besides those about single messages and about doors.

    Args:
        lasers: Where scans came from.
        sightings: What came of them.
        when: Writes a stamp.
    """
    for topic, counts in lasers.counts.items():
        if (jump := counts.worst_jump) is not None:
            most = f"by {jump} at {when(jump.stamp_ns)}"
            yield f"{topic}: the pose jumps: {counts.jumps:,} scans dropped, the most {most}"
    for why, count in sorted(sightings.not_used.items()):
        yield f"scans that were not looked through: {why} ({count:,} times)"
    tally = sightings.tally
    if tally.last_level is not None and not tally.doors:
        yield tally.nothing_met(tally.last_level)


def door_oddities_of(sightings: LaserSightings, known: Known) -> Iterator[str]:
    """Yield what is odd about doors, which are called by their names."""
    yield from sightings.tally.warnings(lambda door_id: called(door_id, known.doors.get(door_id)))


def called(door_id: int, door: Door | None) -> str:
    """Return what to call a door."""
    return f"{door_id} ({door.name})" if door and door.name else str(door_id)


MOVED_M = 0.5
"""So far apart the robot's places are, of which the nearest door is looked up."""


@dataclass(slots=True)
class VisitTally:
    """Counts visits, door by door."""

    doors: dict[DoorId, DoorFigures] = field(default_factory=dict)
    again: int = 0
    """Visits that only repeated a report from the same place: nothing else of them is kept."""
    nearest: tuple[float, int] = (math.inf, 0)
    """How near the robot came to the middle of a door, m, and to which."""
    glass: set[DoorId] = field(default_factory=set)
    """Doors that are known to be of glass."""
    levels: Counter[int] = field(default_factory=Counter)
    """How many doors each level had at most, at any moment of the scans."""
    _last: tuple[int, float, float] | None = None

    def add(self, visit: Visit) -> None:
        """Count a visit."""
        self.doors.setdefault(visit.door_id, DoorFigures(visit.door_id)).add(visit)

    def stood(self, pose: RobotPose, doors: DoorPlaces) -> None:
        """Take note of where the robot was, and of the doors of that moment."""
        last = self._last
        if last and last[0] == pose.level and math.dist(last[1:], (pose.x, pose.y)) < MOVED_M:
            return
        self._last = (pose.level, pose.x, pose.y)
        self.glass.update(map(DoorId, doors.ids[doors.glass].tolist()))
        self.levels |= Counter(doors.levels.tolist())
        here = doors.levels == pose.level
        if not here.any():
            return
        x, y, theta, width = doors.lines[here].T
        away = np.hypot(
            x + width / 2 * np.cos(theta) - pose.x, y + width / 2 * np.sin(theta) - pose.y
        )
        least = int(np.argmin(away))
        self.nearest = min(self.nearest, (float(away[least]), int(doors.ids[here][least])))

    @property
    def last_level(self) -> int | None:
        """Return where the robot was last; None: there was no scan."""
        return self._last[0] if self._last else None

    @property
    def visits(self) -> Counter[DoorState]:
        """How many visits say which state; passages are counted apart."""
        found: Counter[DoorState] = Counter()
        for door in self.doors.values():
            found[DoorState.OPEN] += door.open
            found[DoorState.CLOSED] += door.closed
            found[DoorState.UNKNOWN] += door.undecided
        return found

    @property
    def undecided(self) -> Counter[str]:
        """Why visits are undecided -> how many."""
        return sum((door.reasons for door in self.doors.values()), Counter[str]())

    @property
    def passages(self) -> int:
        """How often the robot drove through a door."""
        return sum(door.passed for door in self.doors.values())

    def summary(self) -> Iterator[str]:
        """Yield in words what there was."""
        seen = self.visits
        visits = seen.total() + self.passages
        if not visits:
            yield "visits: none"
            return
        yield (
            f"visits: {visits:,} to {counted(len(self.doors), 'door')}: "
            f"{seen[DoorState.OPEN]:,} OPEN, {seen[DoorState.CLOSED]:,} CLOSED, "
            f"{self.passages:,} driven through, {seen[DoorState.UNKNOWN]:,} undecided"
        )
        if self.again:
            yield (
                f"seen again from the same stand: {counted(self.again, 'visit')} with the state "
                "reported before (not written: a robot that stands still gains no evidence)"
            )
        if reasons := self.undecided:
            told = ", ".join(f"{why} {n:,}" for why, n in reasons.most_common())
            yield f"undecided, so nothing is written of them: {told}"

    def warnings(self, name_of: Callable[[int], str]) -> Iterator[str]:
        """Yield what is odd; a door is called by `name_of` its id."""
        doors = [self.doors[door_id] for door_id in sorted(self.doors)]
        for warning in door_warnings(doors, glass=self.glass):
            yield warning.about(name_of(warning.door_id))

    def nothing_met(self, level: int) -> str:
        """Return why no door was met, as far as it is known."""
        metres, door_id = self.nearest
        if not self.levels:
            return "the log had no door with a place at the time of the scans"
        if not self.levels[level]:
            there = ", ".join(map(str, sorted(self.levels)))
            return f"the scans are of level {level}, the doors on level {there}: say which, --level"
        if metres > REACH_M:
            return (
                f"no door was ever within {REACH_M:g} m (nearest: door {door_id}, {metres:.1f} m): "
                "are the scans on the log's map, and is the map frame right?"
            )
        return (
            f"doors were within {REACH_M:g} m (nearest: door {door_id}, {metres:.1f} m), but no "
            "beam reached the line of one"
        )


METHOD = "leaf-likelihood"
"""How a laser's scans are judged: part of a sighting's source."""
KEEP_NS = 60 * 10**9
"""Of where the robot was: longer than any visit."""
WAY_NS = 3 * 10**9
"""So far apart are the places that are kept of a robot's way through a visit."""
LATE_NS = 10 * 10**9
"""By how much the scans of one laser may lag those of another."""


class DoorsOverTime(Protocol):
    """The doors over time."""

    def at(self, when_ns: int) -> DoorPlaces:
        """Return those of a moment; the same object as before where nothing changed."""

    def state(self, door_id: int, since_ns: int, when_ns: int) -> DoorState | None:
        """Return a door's state at a moment, by reports after `since_ns`; None: there are none."""


@dataclass(frozen=True, slots=True)
class VisitCommit:
    """What a visit says, for the log."""

    visit: Visit
    events: list[Event]
    note: Note
    way: tuple[RobotPose, ...] = ()
    """Where the robot was meanwhile, some seconds apart."""


def source_of(visit: Visit) -> str:
    """Return what a visit's commit names as its source: the laser and the method.

    The same for the same laser in every bag, so that `calibrate --source` finds it.
    """
    return f"scan:{visit.laser} {METHOD}"


def is_laser(source: str) -> bool:
    """Return whether a commit's source is a laser whose visits were recorded."""
    return source.startswith("scan:") and source.endswith(f" {METHOD}")


@dataclass(slots=True)
class LaserSightings:
    """Looks at doors through scans, and makes commits of the visits that decide something."""

    doors: DoorsOverTime
    robot: str = ""
    """Who saw it, if a scan has no robot."""
    tally: VisitTally = field(default_factory=VisitTally)
    keeper: ScanKeeper | None = None
    """What keeps the scans of all visits; None: nobody does."""
    _watcher: DoorWatcher = field(default_factory=DoorWatcher)
    _tracks: dict[str, _Track] = field(default_factory=dict)
    """Of each robot."""
    _said: dict[DoorId, tuple[int, DoorState]] = field(default_factory=dict)
    """Door -> the time and the state of the last visit to it."""

    def take(self, scans: Sequence[RobotScan]) -> Iterator[VisitCommit]:
        """Look at scans, in the order in which they were placed; yield what ended."""
        for each in scans:
            self._tracks.setdefault(each.scan.robot, _Track()).add(each.pose)
            self.tally.stood(each.pose, self.doors.at(each.scan.stamp_ns))
        for places, group in groupby(scans, lambda each: self.doors.at(each.scan.stamp_ns)):
            yield from self._look([each.scan for each in group], places)
        for track in self._tracks.values():
            track.forget()

    def end(self, robot: str) -> Iterator[VisitCommit]:
        """Yield what the visits say that were going on, of a robot that is silent."""
        yield from self._made(self._watcher.end(robot))

    def close(self) -> Iterator[VisitCommit]:
        """Yield what the visits say that were going on."""
        yield from self._made(self._watcher.close())

    def _look(self, scans: Sequence[PlacedScan], places: DoorPlaces) -> Iterator[VisitCommit]:
        if self.keeper is not None:
            self.keeper.saw(scans, places)
        yield from self._made(self._watcher.take(scans, places))

    @property
    def not_used(self) -> Counter[str]:
        """Why scans that have a place were not looked through, and how many."""
        return self._watcher.dropped

    def _made(self, visits: Sequence[Visit]) -> Iterator[VisitCommit]:
        for visit in visits:
            if self._is_reported(visit):
                self.tally.again += 1
                continue
            if self.keeper is not None:
                self.keeper.keep([visit])
            self.tally.add(visit)
            if visit.passed or visit.state is not DoorState.UNKNOWN:
                self._said[visit.door_id] = (visit.last_ns, visit.state)
                note = Note(actor=visit.robot or self.robot, source=source_of(visit))
                events = [*self._poses(visit), _said(visit)]
                way = self._tracks[visit.robot].between(visit.first_ns, visit.last_ns)
                yield VisitCommit(visit, events, note, way)

    def _is_reported(self, visit: Visit) -> bool:
        """Return whether a visit only repeats a report from the same place that still holds."""
        if not visit.told_ns:
            return False
        at_ns, said = self._said.get(visit.door_id, (visit.told_ns, visit.state))
        state = self.doors.state(visit.door_id, at_ns, visit.last_ns)
        return (said if state is None else state) is visit.state

    def _poses(self, visit: Visit) -> list[Event]:
        """Return where the robot was when it first saw the door, and when it last did."""
        track = self._tracks[visit.robot]
        found = [track.at(when_ns) for when_ns in (visit.first_ns, visit.last_ns)]
        poses = [pose for pose in found if pose is not None]
        return [*dict.fromkeys(poses)]


def _said(visit: Visit) -> Event:
    """Return what a visit that decided says; of the moment of the last scan that saw the door.

    Until then all that it rests on had been seen, and of later it says nothing.
    """
    if visit.passed:
        return DoorPassed(door_id=visit.door_id, passed=True, happened_ns=visit.last_ns)
    accuracy = min(max(visit.accuracy, 0.5), 1.0)
    return DoorObserved(
        door_id=visit.door_id,
        state=visit.state,
        accuracy_open=accuracy,
        accuracy_closed=accuracy,
        opening=visit.opening,
        happened_ns=visit.last_ns,
    )


@dataclass(slots=True)
class _Track:
    """Where a robot was at the scans of the last minute."""

    poses: dict[int, RobotPose] = field(default_factory=dict)
    """By the scans' stamps, in the order in which they came."""

    def add(self, pose: RobotPose) -> None:
        assert pose.happened_ns is not None
        self.poses.pop(pose.happened_ns, None)  # of a clock that was set back since
        self.poses[pose.happened_ns] = pose

    def at(self, when_ns: int) -> RobotPose | None:
        """Return where it was at a scan; None: that is too long ago."""
        return self.poses.get(when_ns)

    def between(self, first_ns: int, last_ns: int) -> tuple[RobotPose, ...]:
        """Return where it was from one scan to another, `WAY_NS` apart; the last one, too."""
        inside = sorted(at for at in self.poses if first_ns <= at <= last_ns)
        chosen: list[int] = []
        for at in inside:
            if not chosen or at - chosen[-1] >= WAY_NS or at == inside[-1]:
                chosen.append(at)
        return tuple(self.poses[at] for at in chosen)

    def forget(self) -> None:
        """Let go of what is older than the last scan by far, or of a clock that was set back."""
        last_ns = next(reversed(self.poses))
        if max(self.poses) - min(self.poses) > KEEP_NS:
            kept = self.poses.items()
            first_ns, end_ns = last_ns - KEEP_NS, last_ns + LATE_NS
            self.poses = {at: pose for at, pose in kept if first_ns <= at <= end_ns}


def named(commit: VisitCommit, note: Note) -> VisitCommit:
    """Return a commit that says who imported it, and what it belongs to: the file.

    Args:
        commit: Its source stays what it is.
        note: Of the import; its source is the file.
    """
    said = replace(
        note, actor=note.actor or commit.note.actor, source=commit.note.source,
        correlation=note.correlation or note.source,
    )  # fmt: skip
    return replace(commit, note=said)


Places = Mapping[int, tuple[DoorLine, int]]
"""Door -> its line and its level."""


class ScanKeeper:
    """Receives all scans, and each visit once it has ended."""

    def __init__(
        self,
        writer: KeptScansWriter,
        *,
        known: Container[tuple[object, ...]] = (),
        tell: Callable[[str], None] | None = None,
    ) -> None:
        """Keep visits.

        Args:
            writer: Takes them.
            known: Keys of visits that are kept already: see `visit_key`.
            tell: Called once if nothing can be written, and nothing more is kept; None: that is
                an error.
        """
        self._writer: KeptScansWriter | None = writer
        self._known, self._tell = known, tell
        self._recent = RecentScans()
        self._doors: DoorPlaces | None = None
        self._now: Places = {}
        """Of all doors that were ever there, as they were last."""
        self._before: Places = {}
        """The same, until `_since_ns`."""
        self._since_ns = 0

    def saw(self, scans: Sequence[PlacedScan], doors: DoorPlaces) -> None:
        """Take scans, in the order of their stamps, through all of which the doors are these."""
        if doors is not self._doors and scans:
            self._doors, self._since_ns = doors, scans[0].stamp_ns
            self._before, self._now = self._now, {**self._now, **_places(doors)}
        self._recent.forget_old()  # before those come, however many, and before their visits end
        for scan in scans:
            self._recent.take(scan)

    def keep(self, visits: Iterable[Visit]) -> None:
        """Keep visits that have ended; one ends before its door changes.

        Raises:
            OutputError: They cannot be written, and there is no callback for the error.
        """
        for visit in visits:
            if visit_key(visit) not in self._known:
                self._keep(visit)

    def _keep(self, visit: Visit) -> None:
        if self._writer is None:
            return
        began_before = visit.first_ns < self._since_ns and visit.door_id in self._before
        line, level = (self._before if began_before else self._now)[visit.door_id]
        try:
            self._writer.keep(visit, line=line, level=level, scans=self._recent.of(visit))
        except OutputError as error:
            if self._tell is None:
                raise
            self._writer.abandon()
            self._writer = None
            self._tell(f"no more scans are kept: {error}")


def _places(doors: DoorPlaces) -> Places:
    rows = zip(doors.ids.tolist(), doors.levels.tolist(), doors.lines.tolist(), strict=True)
    return {door_id: ((x, y, theta, width), level) for door_id, level, (x, y, theta, width) in rows}
