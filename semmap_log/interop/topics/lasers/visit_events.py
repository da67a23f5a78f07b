"""Visits to doors, as the commits that they become."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Protocol

from semmap_log.analysis.scans.door_watcher import DoorWatcher
from semmap_log.analysis.scans.placed_scan import DoorPlaces, PlacedScan
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorObserved, DoorPassed, Event, RobotPose
from semmap_log.interop.topics.lasers.lasers import RobotScan
from semmap_log.interop.topics.lasers.scan_keeper import ScanKeeper
from semmap_log.interop.topics.lasers.visit_tally import VisitTally

METHOD = "leaf-likelihood"
"""How a laser's scans are judged: part of a sighting's source."""
KEEP_NS = 60 * 10**9
"""Of where the robot was: longer than any visit."""
WAY_NS = 3 * 10**9
"""So far apart are the places that are kept of a robot's way through a visit."""
LATE_NS = 10 * 10**9
"""So far the scans of one laser may be behind those of another."""


class DoorsOverTime(Protocol):
    """The doors over time."""

    def at(self, when_ns: int) -> DoorPlaces:
        """Return those of a moment; the same object as before where nothing changed."""

    def state(self, door_id: int, since_ns: int, when_ns: int) -> DoorState | None:
        """Return how a door is by then, by what was said after `since_ns`; None: nothing was."""


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
    """Tell whether a commit's source is a laser of which visits are told so."""
    return source.startswith("scan:") and source.endswith(f" {METHOD}")


@dataclass(slots=True)
class LaserSightings:
    """Looks at doors through scans, and makes commits of the visits that decide something."""

    doors: DoorsOverTime
    robot: str = ""
    """Who saw it, where a scan does not tell."""
    tally: VisitTally = field(default_factory=VisitTally)
    keeper: ScanKeeper | None = None
    """What keeps the scans of all visits; None: nobody does."""
    _watcher: DoorWatcher = field(default_factory=DoorWatcher)
    _tracks: dict[str, _Track] = field(default_factory=dict)
    """Of each robot."""
    _said: dict[DoorId, tuple[int, DoorState]] = field(default_factory=dict)
    """Door -> when a visit told of it last, and what."""

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
            if self._is_told(visit):
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

    def _is_told(self, visit: Visit) -> bool:
        """Tell whether a visit says only what was told from the same stand, and still is told."""
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
