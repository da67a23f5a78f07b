"""A level's costmap: floor, doors, and costs around both, at a moment of a log or over time.

Over time, it follows a log's past step by step, or live while another process writes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from semmap_log.analysis.costmap_2d import layered
from semmap_log.analysis.costmap_2d.costs import DoorLayer, DoorLine, static_costs
from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry
from semmap_log.analysis.costmaps.door_layer_fold import By, DoorLayerProjection, door_lines
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.levels import check_class, level_shown, resolve_level
from semmap_log.core.folds.rebasing import are_same
from semmap_log.core.model import events
from semmap_log.core.model.doors import OUTLINE, DoorId, DoorMap, parse_outline
from semmap_log.core.model.moments import Time
from semmap_log.errors import CostmapError
from semmap_log.log import DoorLog, FollowedCommit, Scope, warn_of_clock

MARGIN_M = 1.0
"""Around the doors, where there is no map."""
MOST_CELLS = 100_000_000

Point: TypeAlias = tuple[float, float]
"""(x, y), metres, frame `map`."""


@dataclass(frozen=True, slots=True)
class CostmapOptions:
    """How a costmap is made; names and defaults of ROS's parameters in brackets."""

    level: int | str | None = None
    """Number or name; None: the only one there is, or of several the only one with doors."""
    by: By = "state"
    inflate_m: float = 0.0
    """How far costs reach around walls and closed doors (inflation_radius); 0: not at all."""
    scaling: float = 10.0
    """How fast they fall off, 1/m (cost_scaling_factor)."""
    inscribed_m: float = 0.0
    """The robot's inscribed radius: so near it surely touches."""
    door_inflate_m: float = 0.0
    """How far they reach around doors that are, or may be, closed; 0: as around walls."""
    resolution: float = 0.05
    """Metres a cell, where there is no map."""
    object_class: str | None = None
    """Only objects of that class; None: all."""


class Costmap:
    """The costmap of a level at a moment: doors over the floor, and costs around both."""

    def __init__(
        self,
        state: DoorMapState,
        geometry: GridGeometry,
        floor: events.FloorMap | None,
        level: int,
        options: CostmapOptions,
    ) -> None:
        self.geometry = geometry
        self.level = level
        self.floor = floor
        """The floor map below the doors; None: there is none, and all else is unknown."""
        self.options = options
        self._projection = DoorLayerProjection(geometry, level, options.by, options.object_class)
        self._state = self._projection.of(state)
        layers = layers_of(geometry, floor, self.layer, options)
        self.master = layered.LayeredCostmap(geometry, layers, track_unknown=floor is None)
        self.master.update()

    @property
    def layer(self) -> DoorLayer:
        """The doors alone."""
        return self._state.layer

    @property
    def doors(self) -> DoorMap:
        """All doors at that moment, those of other levels and those without a place, too."""
        return self._state.map.door_map()

    @property
    def lines(self) -> dict[DoorId, DoorLine]:
        """What the level's doors draw, ids ascending; on the map or off it."""
        options = self.options
        return door_lines(self.doors, level=self.level, by=options.by, only=options.object_class)

    def advance(self, batches: Iterable[EventBatch]) -> list[CellWindow]:
        """Take in what happened next; return where cells of the master may have changed."""
        for batch in batches:
            self._state = self._projection.apply(self._state, batch)
        return self.master.update()

    def show(self, state: DoorMapState) -> list[CellWindow]:
        """Take another door map instead; return where cells of the master may have changed."""
        self._state.map = state
        self.layer.draw(self.lines)
        return self.master.update()


def layers_of(
    geometry: GridGeometry, floor: events.FloorMap | None, doors: DoorLayer, options: CostmapOptions
) -> list[layered.CostmapLayer]:
    """Return the layers of a costmap, lowest first: floor, doors, and costs around them.

    Raises:
        CostmapError: A radius cannot be drawn on that grid.
    """
    layers = list[layered.CostmapLayer]()
    if floor is not None:
        layers.append(layered.StaticLayer(geometry, static_costs(floor.cells)))
    layers.append(doors)
    for radius, around in ((options.inflate_m, None), (options.door_inflate_m, doors)):
        if radius:
            layers.append(
                layered.InflationLayer(
                    geometry,
                    radius,
                    scaling=options.scaling,
                    inscribed=options.inscribed_m,
                    around=around,
                )
            )
    return layers


def costmap_at(
    log: DoorLog,
    options: CostmapOptions = CostmapOptions(),
    *,
    at: Time = None,
    known_at: Time = None,
    event: int | None = None,
    floor: events.FloorMap | None = None,
) -> Costmap:
    """Return the costmap of a level at a moment; without arguments: now.

    Args:
        log: Where the doors are from.
        options: Which level, and what is drawn how.
        at: What was true then, with all that is known today.
        known_at: Only what had been recorded by then.
        event: Only what has a number up to that.
        floor: The floor to draw on; default: the log's own of that level and moment. If there is
            none, the grid lies around the level's doors.

    Raises:
        CostmapError: There is neither floor nor door, or the floor is turned against its grid.
        CommandError: There is no such class.
        UnknownLevelError: No such level, or several and none was named.
    """
    state = log.state_in(log.scope(at, known_at, event))
    doors = state.door_map()
    if options.object_class is not None:
        check_class(doors, options.object_class)
    level = level_drawn(options, doors)
    floor = floor or log.floor_of(doors, level)
    geometry = geometry_of(floor, ends_of(doors, level), level, options)
    return Costmap(state, geometry, floor, level, options)


def level_drawn(options: CostmapOptions, doors: DoorMap) -> int:
    """Return the level whose costmap is requested.

    Raises:
        UnknownLevelError: No such level, or several have doors and none was named.
    """
    return level_shown(doors) if options.level is None else resolve_level(options.level, doors)


def geometry_of(
    floor: events.FloorMap | None, points: Sequence[Point], level: int, options: CostmapOptions
) -> GridGeometry:
    """Return the floor's grid, or one around these points.

    Raises:
        CostmapError: There is neither, or the floor is turned.
    """
    if floor is None:
        return _around(points, level, options.resolution)
    return GridGeometry.of_floor(floor)


def ends_of(doors: DoorMap, level: int) -> list[Point]:
    """Return both ends of all doors on a level, and the corners of what has an outline."""
    on_level = (door for door in doors.doors.values() if door.is_placed and door.level == level)
    return [point for door in on_level for point in door.extent]


def _around(ends: Sequence[Point], level: int, cell_m: float) -> GridGeometry:
    """Return a grid with a margin around these points."""
    points = np.array(ends)
    if not len(points):
        raise CostmapError(
            f"level {level} has no floor map, and no door with a place: there is nothing "
            "to draw. Give a map, or another level or moment."
        )
    if not (math.isfinite(cell_m) and cell_m > 0):
        raise CostmapError(f"the resolution: expected metres a cell, above 0, got {cell_m!r}")
    with np.errstate(over="ignore", invalid="ignore"):  # infinite: too many, or NaN, reported below
        low = np.floor((points.min(axis=0) - MARGIN_M) / cell_m)
        width, height = np.ceil((points.max(axis=0) + MARGIN_M) / cell_m) - low
        fits = bool(width * height <= MOST_CELLS)
    if not fits:
        raise CostmapError(
            f"a grid around the doors: expected at most {MOST_CELLS:,} cells of {cell_m:g} m, "
            f"got {width:,.15g} x {height:,.15g}; give a map, or a greater resolution, or remove "
            "the door that is far away"
        )
    return GridGeometry(int(width), int(height), cell_m, *(low * cell_m).tolist())


@dataclass(frozen=True, slots=True)
class CostmapFrame:
    """A moment at which the costmap changed."""

    at_ns: int
    """Happened time; live, when the commit was recorded."""
    event: int
    """Number of the last event in it."""
    windows: Sequence[CellWindow]
    """Where cells of the master may have changed."""
    costmap: Costmap
    """To look at: it goes on with the next frame. Where the level got another floor map, it is
    another one, on another grid."""


def costmap_frames(
    log: DoorLog,
    options: CostmapOptions = CostmapOptions(),
    *,
    since: Time = None,
    until: Time = None,
    floor: events.FloorMap | None = None,
) -> Iterator[CostmapFrame]:
    """Yield the costmap at `since`, then at each later moment at which something changed.

    What counts is what was true, with all that is known today: late events come in their place.

    Args:
        log: Where the doors are from.
        options: Which level, and what is drawn how.
        since: Default: before the first event, or the log's horizon.
        until: The last moment; default: the log's end.
        floor: As for `costmap_at`; the log's own is that of each moment, and before the first the
            first.

    Raises:
        CostmapError: As for `costmap_at`.
        UnknownLevelError: As for `costmap_at`.
    """
    first_ns, end_ns = log.instant(since), log.instant(until)
    warn_of_clock(log, first_ns)
    if first_ns is None:
        later_ns = log.shown_from_ns(None, None if end_ns is None else end_ns + 1)
        first_ns = _first_ns(log) if later_ns is None else later_ns - 1
    end_ns = log.end_ns() if end_ns is None else end_ns
    at_end = log.replay(at=end_ns)
    level = level_drawn(options, at_end)
    kinds = DRAWN_KINDS if at_end.classes else events.SETTING_KINDS
    floors = [(first_ns, floor)] if floor is not None else _floors(log, level, first_ns, end_ns)
    ends = [since_ns for since_ns, _ in floors[1:]] + [end_ns + 1]
    for (since_ns, drawn), until_ns in zip(floors, ends, strict=True):
        yield from _frames_on(log, drawn, level, options, (since_ns, until_ns - 1), kinds=kinds)


def _floors(
    log: DoorLog, level: int, first_ns: int, end_ns: int
) -> list[tuple[int, events.FloorMap | None]]:
    """Return the floor maps of a level in a span of time, each with from when on it is drawn."""
    stamps = [
        (min(each.happened_ns, each.recorded_ns), each.number)
        for batch in log.batches(kinds=[events.FloorMap])
        for each in batch
        if isinstance(each.event, events.FloorMap) and each.event.level == level
    ]
    numbers = {max(at_ns, first_ns): n for at_ns, n in sorted(stamps) if at_ns <= end_ns}
    floors: list[tuple[int, events.FloorMap | None]] = []
    for at_ns, number in numbers.items():
        floor = log.event(number).event
        assert isinstance(floor, events.FloorMap)
        if not floors or not are_same([replace(floor, happened_ns=None)], [floors[-1][1] or floor]):
            floors.append((at_ns if floors else first_ns, floor))
    return floors or [(first_ns, None)]


def _frames_on(
    log: DoorLog,
    floor: events.FloorMap | None,
    level: int,
    options: CostmapOptions,
    span: tuple[int, int],
    *,
    kinds: Sequence[type[events.Event]],
) -> Iterator[CostmapFrame]:
    """Yield the costmap on one floor map: at the first moment, and each change up to the last."""
    first_ns, last_ns = span
    state = log.state_in(log.scope(at=first_ns))
    later = list(log.batches(first_ns + 1, last_ns + 1, kinds=kinds))
    points = [*ends_of(state.door_map(), level), *_places(later, level, state.door_map())]
    costmap = Costmap(state, geometry_of(floor, points, level, options), floor, level, options)
    yield CostmapFrame(first_ns, state.event, [costmap.geometry.whole], costmap)
    for at_ns, batches in _in_order(later):
        windows = costmap.advance(batches)
        if windows:
            yield CostmapFrame(at_ns, state.event, windows, costmap)


def costmap_live(
    log: DoorLog,
    options: CostmapOptions = CostmapOptions(),
    *,
    floor: events.FloorMap | None = None,
    poll_s: float = 0.1,
    stop: Callable[[], bool] | None = None,
) -> Iterator[CostmapFrame]:
    """Yield the costmap of now, then one for each commit that changes it, while another writes.

    What a retraction takes back is gone with the retraction's commit. The grid stays as it is until
    the level gets another floor map; then the costmap is another one, on that.

    Args:
        log: Where the doors are from; it stays as it was opened.
        options: Which level, and what is drawn how.
        floor: As for `costmap_at`.
        poll_s: How long to wait before looking again, when nothing was new.
        stop: Called before each poll; once it returns true, the iteration ends with what is there.

    Raises:
        CostmapError: As for `costmap_at`.
        UnknownLevelError: As for `costmap_at`.
        LogError: As for `DoorLog.follow`.
    """
    costmap = costmap_at(log, options, floor=floor)
    known = costmap.doors
    yield CostmapFrame(known.latest_ns, known.event, [costmap.geometry.whole], costmap)
    for followed in log.follow(known.event, poll_s=poll_s, stop=stop):
        commit, batch = followed.commit, followed.batch
        anew = None if floor is not None else _on_another_map(log, costmap, options, followed)
        if anew is not None:
            costmap = anew
            windows: Sequence[CellWindow] = [costmap.geometry.whole]
        elif events.Retracted in batch:
            windows = costmap.show(log.reopened_log().state_in(Scope(event=commit.last_event)))
        else:
            windows = costmap.advance([batch])
        if windows:
            yield CostmapFrame(commit.recorded_ns, commit.last_event, windows, costmap)


def _on_another_map(
    log: DoorLog, costmap: Costmap, options: CostmapOptions, followed: FollowedCommit
) -> Costmap | None:
    """Return the costmap on the floor map that a commit gives its level; None: none is new."""
    if not any(kind in followed.batch for kind in (events.FloorMap, events.Retracted)):
        return None
    last = followed.commit.last_event
    there = costmap_at(log.reopened_log(), options, event=last)
    return None if there.floor is None or there.floor == costmap.floor else there


def _in_order(batches: list[EventBatch]) -> Iterator[tuple[int, list[EventBatch]]]:
    """Yield the events of each happened time, times ascending: halves, and halves of them."""
    times = np.unique(np.concatenate([batch.folds_ns for batch in batches] or [np.empty(0, "i8")]))
    if len(times) < 2:
        yield from [(int(at_ns), batches) for at_ns in times]
        return
    middle = times[len(times) // 2]
    for chosen in (np.less, np.greater_equal):
        half = (batch.select(chosen(batch.folds_ns, middle)) for batch in batches)
        yield from _in_order([batch for batch in half if len(batch)])


def _first_ns(log: DoorLog) -> int:
    """Return a moment just before the first event that draws something; of none, the log's end."""
    firsts = (int(batch.folds_ns.min()) for batch in log.batches(kinds=events.SETTING_KINDS))
    return min(firsts, default=log.end_ns() + 1) - 1


def _places(batches: Sequence[EventBatch], level: int, before: DoorMap) -> Iterator[Point]:
    """Yield points around all places on a level where events put doors.

    A door's width at the time, or the corners of its outline, may be in other events: the widest
    of all is taken.
    """
    kinds = [(batch, kind) for batch in batches for kind in events.POSE_KINDS]
    told = [batch[kind] for batch, kind in kinds if kind in batch]
    reaches = [math.dist(door.start, end) for door in before.doors.values() for end in door.extent]
    for rows in told:
        reaches += rows["width"].tolist()
    for batch in batches:
        for event in batch.objects.get(events.DoorAnnotated.kind, ()):
            reaches += _reaches(event)
    widest = max((reach for reach in reaches if not math.isnan(reach)), default=0.0)
    is_outlined = any(events.DoorAnnotated in batch for batch in batches)
    for door in before.doors.values() if is_outlined else ():
        if door.is_placed and door.level == level:
            yield door.x - widest, door.y - widest
            yield door.x + widest, door.y + widest
    for rows in told:
        places = rows[(rows["level"] == level) & np.isfinite(rows["x"] + rows["y"])]
        for x, y in zip(places["x"].tolist(), places["y"].tolist(), strict=True):
            yield x - widest, y - widest
            yield x + widest, y + widest


def _reaches(event: events.Event) -> Iterator[float]:
    """Yield how far the corners of an outline are from where their object is, metres."""
    if isinstance(event, events.DoorAnnotated) and event.key == OUTLINE:
        with suppress(ValueError):
            yield from (math.hypot(x, y) for x, y in parse_outline(event.value))


DRAWN_KINDS = (*events.SETTING_KINDS, events.DoorAnnotated, events.ClassDefined)
"""Kinds of events that may change what is drawn: the annotations of an object say what it is."""
