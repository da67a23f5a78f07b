"""The first pass over a log: what a recording of it will show.

Names, lifetimes and bounds must be known before the first row is drawn: a door may get its name
long after its first event, and a late event may report its removal. The pass keeps a few numbers a
door, whatever the log's length.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_changes import THERE, Changes, Stamp, door_changes, of_presence
from semmap_log.core.folds.levels import levels_of
from semmap_log.core.folds.renumbering import robots_of
from semmap_log.core.model.doors import Door, DoorId, DoorMap
from semmap_log.core.model.events import DoorAnnotated, RobotPose
from semmap_log.core.model.meaning import FIELDS, Changed, Presence
from semmap_log.log import Scope
from semmap_log.views.bounds import Bounds, bounds_of_floor
from semmap_log.views.costmap_picture import without_level
from semmap_log.views.excerpt import door_rows
from semmap_log.views.excerpt.shown_levels import home_of_0
from semmap_log.views.excerpt.span import NO_PLANS, Excerpt, level_plans
from semmap_log.views.rerun.drawable import drawable_name, free_part, unique_parts
from semmap_log.views.rerun.scene import ROOT, KnownDoor, Scene, SceneDoor, SceneLevel
from semmap_log.views.rerun.shown_retractions import ShownRetraction, taken_back

GIVEN = int(Changed.PROB_OPEN | Changed.PROB_CLOSED)
NOWHERE = door_rows.RecordingEdge(-1, -1, -1)


def find_scene(excerpt: Excerpt) -> Scene:
    """Return what a recording of a part of a log has to show."""
    taken = RecordingContents(excerpt)
    for batch in excerpt.read():
        taken.take(batch)
    return taken.scene()


class RecordingContents:
    """What a recording has to show of the events taken so far."""

    def __init__(self, excerpt: Excerpt) -> None:
        self._excerpt = excerpt
        self._pass = _Pass(excerpt)
        self._is_whole = False

    def take(self, batch: EventBatch) -> None:
        """Take the next events, in order of their numbers."""
        self._pass.take(batch)

    def is_late(self, batch: EventBatch) -> bool:
        """Return whether an event sorts before an event of the same door that was already taken."""
        return any(
            not self._pass.doors.get(DoorId(int(rows["door_id"][0])), NEW).goes_on(rows)
            for rows in door_rows.by_door(door_changes(batch))
        )

    def scene(self) -> Scene:
        """Return the scene of all events taken; names and floor plans are those of today."""
        pass_ = self._pass
        if not self._is_whole:
            self._is_whole = True  # from here on, nothing is retracted any more
            for one in taken_back(self._excerpt):
                pass_.take_back(one)
        state = self._excerpt.log.state_in(Scope(at_ns=self._excerpt.last_ns()))
        doors, shapes = state.door_map(), door_rows.shapes_of(state)
        placed = {n for door in pass_.doors.values() if door.was_present for n in door.placed_on}
        home = home_of_0(placed | levels_of(doors).keys())
        robot_level = pass_.robot_last[1]
        levels = _levels(self._excerpt, doors, pass_, home)
        return Scene(
            doors=_doors(pass_, levels, home, shapes),
            levels=levels,
            home_of_0=home,
            robot_level=home if robot_level == 0 else robot_level,
            robots=robots_of(self._excerpt.log.info.robot),
            events=pass_.events,
            commits=np.concatenate([np.empty(0, np.int64), *pass_.commits]),
            begin=pass_.begin,
            end=pass_.end,
        )


@dataclass(slots=True)
class _Found:
    """The pass's data about a door."""

    before: Door | None = None
    known: list[KnownDoor] = field(default_factory=list)
    was_present: bool = False
    added: Stamp = door_rows.NEVER
    removed: Stamp = door_rows.NEVER
    name: str = ""
    name_stamp: Stamp = door_rows.ALWAYS
    levels: dict[int, Stamp] = field(default_factory=dict)
    """Level -> when the door was last put there."""
    placed_on: set[int] = field(default_factory=set)
    """Levels on which it had a place."""
    state: int | None = None
    state_changes: int = 0
    has_probabilities: bool = False
    latest: Stamp = door_rows.ALWAYS
    is_plain: bool = True
    disturbed: list[NDArray[np.int64]] = field(default_factory=list)

    def take(
        self, changes: Changes, happened: NDArray[np.bool_], recorded: NDArray[np.bool_]
    ) -> None:
        """Take this door's rows, in order of their numbers.

        Args:
            changes: The rows.
            happened: Which of them stand on the timeline `happened`.
            recorded: Which of them stand on `recorded` and `event`.
        """
        both = happened & recorded
        latest_ns = np.maximum.accumulate(np.append(self.latest[0], changes["folds_ns"]))
        is_late = changes["folds_ns"] < latest_ns[1:]
        self.latest = int(latest_ns[-1]), int(changes["number"][-1])
        self.is_plain &= bool(both.all()) and not is_late.any()
        sets_state = (changes["sets"] & int(Changed.STATE)) != 0
        self.disturbed.append(changes["folds_ns"][sets_state & (is_late | ~both)])
        self.was_present |= bool(of_presence(changes, Presence.COMES).any())
        placed = changes[(changes["sets"] & int(Changed.POSE)) != 0]
        for level, stamp in zip(placed["level"].tolist(), _stamps(placed), strict=True):
            self.levels[level] = max(stamp, self.levels.get(level, door_rows.ALWAYS))
        self.placed_on.update(placed["level"][np.isfinite(placed["x"])].tolist())
        given = changes[(changes["sets"] & GIVEN) != 0]
        self.has_probabilities |= bool(
            np.isfinite(given["prob_open"]).any() or np.isfinite(given["prob_closed"]).any()
        )
        self._count_states(changes["state"][sets_state & happened])
        self._live(changes[happened & ((changes["sets"] & THERE) != 0)])

    def know(self, known: KnownDoor) -> None:
        """Take a state from which it continues along `recorded`."""
        self.known.append(known)
        self.was_present |= known.is_there
        if known.is_placed:
            self.levels.setdefault(known.level, door_rows.ALWAYS)
            self.placed_on.add(known.level)

    def _live(self, changes: Changes) -> None:
        comes = of_presence(changes, Presence.COMES).tolist()
        for is_adding, stamp in zip(comes, _stamps(changes), strict=True):
            if is_adding:
                self.added = stamp
            else:
                self.removed = stamp

    def goes_on(self, changes: Changes) -> bool:
        """Return whether all of this door's next rows come after those already taken, in order."""
        first = int(changes["folds_ns"][0]), int(changes["number"][0])
        return first >= self.latest and bool((np.diff(changes["folds_ns"]) >= 0).all())

    def _count_states(self, states: np.ndarray) -> None:
        if len(states):
            self.state_changes += int(self.state is not None and states[0] != self.state)
            self.state_changes += int(np.count_nonzero(states[1:] != states[:-1]))
            self.state = int(states[-1])

    @property
    def life(self) -> door_rows.DoorLifetime:
        """When it is in the map; a removal before its addition was of no door."""
        return door_rows.DoorLifetime(
            self.added, self.removed if self.removed > self.added else door_rows.NEVER
        )

    @property
    def last_level(self) -> int:
        """The level it was put on last."""
        return max(self.levels, key=lambda level: self.levels[level], default=0)

    @property
    def ever_on(self) -> list[int]:
        """All levels it is put on, ascending."""
        return sorted({*self.levels, self.last_level})


def _stamps(changes: Changes) -> Iterable[Stamp]:
    return zip(changes["folds_ns"].tolist(), changes["number"].tolist(), strict=True)


NEW = _Found()
"""A door without any event yet."""


class _Pass:
    """The data gathered over all batches."""

    def __init__(self, excerpt: Excerpt) -> None:
        self._excerpt = excerpt
        self.doors: dict[DoorId, _Found] = {}
        self.bounds: dict[int, Bounds] = {}
        """Of the doors, by the level."""
        self.robot_bounds: dict[int, Bounds] = {}
        """Of the robots' tracks; level 0 is not yet mapped to where it is shown."""
        self.robot_last: tuple[int, int | None] = (-1, None)
        """Happened time and level of the robot's latest pose."""
        self.events = 0
        self.commits: list[NDArray[np.int64]] = []
        self._last_commit: NDArray[np.int64] = np.full(1, -1)
        self.begin = self.end = NOWHERE
        if excerpt.since_ns is not None:
            self.begin = door_rows.RecordingEdge(
                excerpt.since_ns, excerpt.number_before(), excerpt.since_ns
            )
            self.end = self.begin
            self._begin_in_midst()

    def _begin_in_midst(self) -> None:
        """Take the doors as they were, and as they were known, when the recording begins."""
        for door_id, door in self._excerpt.before().doors.items():
            self.doors[door_id] = _Found(before=door, name=door.name or "")
        opening = door_rows.opening_changes(
            [d.before for d in self.doors.values() if d.before], self.begin
        )
        everywhere = np.ones(len(opening), np.bool_)
        self._take_changes(opening, everywhere, everywhere)
        state = self._excerpt.known_before()
        chosen = self._excerpt.doors
        for door_id in map(DoorId, {*state.used_door_ids, *self.doors}):
            if chosen is None or door_id in chosen:
                found = self.doors.setdefault(door_id, _Found())
                found.know(KnownDoor.of(state, door_id, self.begin))
                found.is_plain &= _values(state.door(door_id)) == _values(found.before)

    def take_back(self, what: ShownRetraction) -> None:
        """Update the doors to what is known after a retraction."""
        state = self._excerpt.log.state_in(Scope(event=what.edge.number))
        for door_id in what.doors & self.doors.keys():
            self.doors[door_id].know(KnownDoor.of(state, door_id, what.edge))
            self.doors[door_id].is_plain = False

    def take(self, whole: EventBatch) -> None:
        bases = whole.recorded_ns - whole.number  # the same in all of a commit, and in no other
        starts = np.append(self._last_commit, bases)[:-1] != bases
        self.commits.append(whole.number[starts])
        self._last_commit = bases[-1:]
        batch = self._excerpt.chosen(whole)
        if not len(batch):
            return
        folds_ns = batch.folds_ns
        happened, recorded = self._stands(batch.number, folds_ns, batch.recorded_ns)
        if self.begin is NOWHERE:
            self.begin = door_rows.RecordingEdge(int(folds_ns[0]), int(batch.number[0]) - 1,
                              int(batch.recorded_ns[0]) - 1)  # fmt: skip
        self.events += len(batch)
        if happened.any():
            self._stretch_time(folds_ns[happened])
        if recorded.any():
            last = np.flatnonzero(recorded)[-1]
            self.end = replace(self.end, number=int(batch.number[last]),
                               recorded_ns=int(batch.recorded_ns[last]))  # fmt: skip
        changes = door_changes(batch)
        stands = self._stands(changes["number"], changes["folds_ns"], changes["recorded_ns"])
        self._take_changes(changes, *stands)
        self._take_poses(batch, happened)
        self._take_names(batch, happened)

    def _stretch_time(self, folds_ns: NDArray[np.int64]) -> None:
        self.begin = replace(self.begin, folds_ns=min(self.begin.folds_ns, int(folds_ns.min())))
        self.end = replace(self.end, folds_ns=max(self.end.folds_ns, int(folds_ns.max())))

    def _stands(
        self,
        numbers: NDArray[np.int64],
        folds_ns: NDArray[np.int64],
        recorded_ns: NDArray[np.int64],
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which events stand on `happened`, and which on `recorded` and `event`."""
        return (
            self._excerpt.has_happened(numbers, folds_ns),
            self._excerpt.was_recorded(numbers, recorded_ns),
        )

    def _take_changes(
        self, changes: Changes, happened: NDArray[np.bool_], recorded: NDArray[np.bool_]
    ) -> None:
        order = np.argsort(changes["door_id"], kind="stable")
        ordered = changes[order]
        for rows in np.split(order, np.flatnonzero(np.diff(ordered["door_id"])) + 1):
            if len(rows):
                door_id = DoorId(int(changes["door_id"][rows[0]]))
                found = self.doors.setdefault(door_id, _Found())
                found.take(changes[rows], happened[rows], recorded[rows])
        placed = changes[(changes["sets"] & int(Changed.POSE)) != 0]
        for level in np.unique(placed["level"]).tolist():
            # Where only the pose is set, the width is not at hand: its end may lie in the margin.
            strips = door_rows.strips_of(placed[placed["level"] == level]).reshape(-1, 2)
            _stretch(self.bounds, level, strips[:, 0], strips[:, 1])

    def _take_poses(self, batch: EventBatch, happened: NDArray[np.bool_]) -> None:
        if RobotPose not in batch:
            return
        poses, where = batch[RobotPose], batch.where(RobotPose)
        folds_ns = np.where(happened, batch.folds_ns, -1)[where]
        if folds_ns.max() >= max(self.robot_last[0], 0):
            latest = int(np.flatnonzero(folds_ns == folds_ns.max())[-1])
            self.robot_last = int(folds_ns[latest]), int(poses["level"][latest])
        for level in np.unique(poses["level"]).tolist():
            here = poses[poses["level"] == level]
            _stretch(self.robot_bounds, level, here["x"], here["y"])

    def _take_names(self, batch: EventBatch, happened: NDArray[np.bool_]) -> None:
        if DoorAnnotated not in batch:
            return
        where = batch.where(DoorAnnotated)
        stamps = zip(batch.folds_ns[where].tolist(), batch.number[where].tolist(), strict=True)
        told = zip(batch.objects[DoorAnnotated.kind], stamps, happened[where].tolist(), strict=True)
        for event, stamp, counts in told:
            assert isinstance(event, DoorAnnotated)
            door = self.doors.setdefault(event.door_id, _Found())
            if counts and event.key == "name" and stamp > door.name_stamp:
                door.name, door.name_stamp = event.value, stamp


def _stretch(bounds: dict[int, Bounds], level: int, x: np.ndarray, y: np.ndarray) -> None:
    bounds[level] = bounds.get(level, Bounds()).around(x, y)


def _levels(
    excerpt: Excerpt, doors: DoorMap, pass_: _Pass, home: int | None
) -> dict[int, SceneLevel]:
    """Return the levels with something on them; where there is one, its path is just `/map`.

    Args:
        excerpt: The part of the log.
        doors: The map at its end.
        pass_: What was found.
        home: Where level 0 is shown; None: doors without a place may still be there.
    """
    known = doors.levels
    there = [door for door in pass_.doors.values() if door.was_present]
    robot = {n or home: bounds for n, bounds in pass_.robot_bounds.items() if n or home is not None}
    used = {n or home or 0 for door in there for n in door.ever_on} | {n or 0 for n in robot}
    if excerpt.doors is None:
        used |= {n for n, level in known.items() if level.floor_map_event is not None}
    numbers = sorted(used) or [0]
    names = {n: level.name or "" for n, level in known.items()}
    names |= {0: "No level"} if home is None else {}
    parts = unique_parts(((n, names.get(n) or str(n)) for n in numbers), "level")
    plans = level_plans(excerpt, numbers)
    levels = {}
    for n in numbers:
        floor = excerpt.log.floor_of(doors, n)
        bounds = pass_.bounds.get(n, Bounds()).including(robot.get(n, Bounds()))
        outlined = [p for door in doors.doors.values() if door.level == n for p in door.outline]
        if outlined:
            bounds = bounds.around(*np.array(outlined).T)
        eras = plans.get(n, NO_PLANS)
        for drawn in [floor, *(era.floor for era in (*eras.happened, *eras.recorded))]:
            if drawn is not None:
                bounds = bounds.including(bounds_of_floor(drawn))
        levels[n] = SceneLevel(
            level=n,
            name=drawable_name(names.get(n) or "", f"Level {n}"),
            path=(ROOT,) if len(numbers) == 1 else (ROOT, parts[n]),
            floor=floor,
            bounds=bounds.framed(),
            is_empty=bounds.is_empty,
            doors=sum((door.last_level or home or 0) == n for door in there),
            has_robot=n in robot,
            plans=eras,
        )
    return levels


def _doors(
    pass_: _Pass,
    levels: Mapping[int, SceneLevel],
    home: int | None,
    shapes: Mapping[DoorId, door_rows.ObjectShape],
) -> dict[DoorId, SceneDoor]:
    """Return the doors that are in the map at some time on some timeline, ids ascending."""
    there = {i: door for i, door in sorted(pass_.doors.items()) if door.was_present}
    last = {i: door.last_level or home or 0 for i, door in there.items()}
    short = {i: without_level(door.name, levels[last[i]].name) for i, door in there.items()}
    parts = _parts(there, short)
    return {
        door_id: SceneDoor(
            door_id=door_id,
            label=_label(door_id, found.name),
            short_label=_label(door_id, short[door_id]),
            path=(*levels[last[door_id]].path, "doors", parts[door_id]),
            lines={
                n: (*levels[n].path, "doors", parts[door_id])
                for n in sorted({n or home or 0 for n in found.ever_on})
            },
            life=found.life,
            before=found.before,
            known=found.known,
            state_changes=found.state_changes,
            has_probabilities=found.has_probabilities,
            shape=shapes.get(door_id, door_rows.AS_A_DOOR),
            is_plain=found.is_plain,
            disturbed_ns=np.sort(np.concatenate([np.empty(0, np.int64), *found.disturbed])),
        )
        for door_id, found in there.items()
    }


def _parts(there: Mapping[DoorId, _Found], short: Mapping[DoorId, str]) -> dict[DoorId, str]:
    """Return a path part for each door, other than those of all that are ever on its levels."""
    parts: dict[DoorId, str] = {}
    taken: dict[int, set[str]] = {}
    for door_id, found in there.items():
        here = [taken.setdefault(n, set()) for n in found.ever_on]
        near = here[0] if len(here) == 1 else set().union(*here)
        parts[door_id] = free_part(door_id, short[door_id], near)
        for names in here:
            names.add(parts[door_id].casefold())
    return parts


def _values(door: Door | None) -> str:
    """Return what is drawn of a door; NaN is like NaN."""
    return "" if door is None else repr([getattr(door, name) for name in FIELDS])


def _label(door_id: DoorId, name: str) -> str:
    return drawable_name(name, f"door {door_id}")
