"""The costmap's door layer in a rerun recording: a small picture of costs for each door.

A whole grid at each change would be gigabytes; a door's cells are some twenty. A picture changes
with its door's state, and with where it and the doors on its cells are. It holds the costs
themselves, so that hovering over a cell shows them, and gets its colours from a context.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, INSCRIBED, LETHAL, NO_INFORMATION
from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import FloorMap
from semmap_log.views.excerpt.door_rows import NO_STATE
from semmap_log.views.excerpt.span import PlanEra
from semmap_log.views.palette import Palette
from semmap_log.views.rerun import costmap_doors
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.robot_track import eras_along, since_of
from semmap_log.views.rerun.scene import (
    EVENT,
    EVERYWHERE,
    HAPPENED,
    RECORDED,
    EntityPath,
    RowWriter,
    Scene,
    SceneLevel,
)

PICTURE = np.dtype(
    [("number", "i8"), ("folds_ns", "i8"), ("recorded_ns", "i8"), ("patch", "i4"), ("cost", "u1")]
)
"""When a door shows which of its patches, at which cost; patch `NO_PATCH`: nothing."""
NO_PATCH = -1

Pictures = NDArray[np.void]


@dataclass(frozen=True, slots=True)
class DoorPatches:
    """A door's pictures on one level, over time."""

    patches: Sequence[costmap_doors.Patch]
    pictures: Pictures

    def behind(self, number: int) -> DoorPatches:
        """Return those from events with greater numbers."""
        return DoorPatches(self.patches, self.pictures[self.pictures["number"] > number])

    def within(self, spans: Sequence[TimeSpan], *, recorded: bool) -> DoorPatches:
        """Return the pictures limited to some spans of time.

        Args:
            spans: Their beginnings and ends, times ascending.
            recorded: Whether the pictures are in the order of recording; else in that of happening.
        """
        parts = [_within(self.pictures, span, recorded=recorded) for span in spans]
        return DoorPatches(self.patches, np.concatenate([self.pictures[:0], *parts]))


class TimeSpan(NamedTuple):
    """When something begins and ends to show; rows of `STAMPS`."""

    since: NDArray[np.void]
    """One row."""
    end: NDArray[np.void] | None
    """One row; None: it lasts."""


def _within(pictures: Pictures, span: TimeSpan, *, recorded: bool) -> Pictures:
    time = "number" if recorded else "folds_ns"
    times, first_time = pictures[time], span.since[time][0]
    first = int(np.searchsorted(times, first_time))
    behind = len(times) if span.end is None else int(np.searchsorted(times, span.end[time][0]))
    shown = pictures[first:behind]
    if first and not (len(shown) and shown[time][0] == first_time):
        shown = np.concatenate([_restamped(pictures[first - 1 : first], span.since), shown])
    if span.end is not None and len(shown):
        nothing = _restamped(shown[-1:], span.end)
        nothing["patch"], nothing["cost"] = NO_PATCH, NO_INFORMATION
        shown = np.concatenate([shown, nothing])
    return shown


def _restamped(picture: Pictures, stamp: NDArray[np.void]) -> Pictures:
    row: Pictures = picture.copy()
    for name in costmap_doors.STAMPS:
        row[name] = stamp[name]
    return row


def patches_along(
    doors: Mapping[DoorId, costmap_doors.DoorRows],
    level: int,
    geometry: GridGeometry,
    *,
    recorded: bool,
) -> Iterator[tuple[DoorId, DoorPatches]]:
    """Yield what each door shows of a level's layer.

    Args:
        doors: Id -> its rows, in the order in question.
        level: The level.
        geometry: Of the layer.
        recorded: Whether in the order of recording; else in that of happening.
    """
    order = costmap_doors.recorded_order if recorded else costmap_doors.happened_order
    for door, versions in costmap_doors.versions_of(doors, level, geometry, order).items():
        yield door, _door_patches(doors[door], versions, order, recorded=recorded)


def _door_patches(
    rows: costmap_doors.DoorRows,
    versions: Sequence[costmap_doors.Version],
    order: costmap_doors.Order,
    *,
    recorded: bool,
) -> DoorPatches:
    """Join a door's states and its patches: one row each time that it looks otherwise."""
    numbers: dict[costmap_doors.Patch, int] = {}
    at = [NO_PATCH if patch is None else numbers.setdefault(patch, len(numbers))
          for _, patch in versions]  # fmt: skip
    stamps = np.concatenate([rows.states, *(costmap_doors.slim(stamp) for stamp, _ in versions)])
    is_state = np.arange(len(stamps)) < len(rows.states)
    patch_of = np.concatenate([np.zeros(len(rows.states), np.int64), np.array(at, np.int64)])
    chosen = order(stamps)
    stamps, is_state, patch_of = stamps[chosen], is_state[chosen], patch_of[chosen]

    pictures = np.zeros(len(stamps), PICTURE)
    for name in costmap_doors.STAMPS:
        pictures[name] = stamps[name]
    pictures["cost"] = rows.shape.costs()[_held(stamps["state"], is_state, NO_STATE)]
    pictures["patch"] = _held(patch_of, ~is_state, NO_PATCH)
    nothing = (pictures["cost"] == NO_INFORMATION) | (pictures["patch"] == NO_PATCH)
    pictures["cost"][nothing], pictures["patch"][nothing] = NO_INFORMATION, NO_PATCH
    return DoorPatches(list(numbers), _changes_of_look(pictures, recorded=recorded))


def _held(values: NDArray[np.generic], sets: NDArray[np.bool_], before: int) -> NDArray[np.int64]:
    """Return at each row the value of the last row that set one."""
    source = np.maximum.accumulate(np.where(sets, np.arange(len(sets)), -1))
    held: NDArray[np.int64] = np.where(source >= 0, values.astype(np.int64)[source], before)
    return held


def _changes_of_look(pictures: Pictures, *, recorded: bool) -> Pictures:
    """Keep the last row of each time, and of those the ones that show something else."""
    time = pictures["number" if recorded else "folds_ns"]
    pictures = pictures[np.append(time[1:] != time[:-1], True)[: len(time)]]
    look = pictures["patch"].astype(np.int64) * 256 + pictures["cost"]
    nothing = NO_PATCH * 256 + NO_INFORMATION
    differs = look != np.append(nothing, look[:-1])[: len(look)]
    kept: Pictures = pictures[differs]
    return kept


COSTMAP = "costmap"

ORDER_OF_LINES, ORDER_OF_AREAS = -5.0, -4.9
"""Objects on the floor are above those in walls."""

NOTHING_WRITTEN = -2
"""Less than any event's number; -1 is what a recording begins with."""


class CostmapWriter:
    """Collects what happens to doors, and writes the layers of all levels at the end.

    More events may come after that, if none of them is late. A level whose floor map is rotated
    against its grid has no costmap. One that was mapped again has a layer on each of its plans.
    """

    def __init__(self, writer: RowWriter, scene: Scene, palette: Palette) -> None:
        self._writer = writer
        self._scene = scene
        self._palette = palette
        self._pieces: dict[str, dict[DoorId, list[costmap_doors.DoorRows]]] = {
            HAPPENED: {},
            RECORDED: {},
        }
        self._has_news = False
        self._written = NOTHING_WRITTEN

    def take(self, door: DoorId, rows: costmap_doors.DoorRows, timelines: Sequence[str]) -> None:
        """Take a door's next rows along these timelines; `event` goes with `recorded`."""
        for timeline, pieces in self._pieces.items():
            if timeline in timelines and len(rows):
                pieces.setdefault(door, []).append(rows)
                self._has_news = True

    def finish(self) -> None:
        """Write the new pictures of all layers."""
        if not self._has_news:
            return
        joined = {
            timeline: {
                door: costmap_doors.DoorRows.joined(rows) for door, rows in sorted(pieces.items())
            }
            for timeline, pieces in self._pieces.items()
        }
        self._write(joined[HAPPENED], joined[RECORDED])
        told = [rows for doors in joined.values() for rows in doors.values()]
        self._written = max(rows.last_number for rows in told)
        self._pieces = {
            timeline: {door: [rows.last()] for door, rows in doors.items()}
            for timeline, doors in joined.items()
        }
        self._has_news = False

    def _write(
        self,
        happened: dict[DoorId, costmap_doors.DoorRows],
        recorded: dict[DoorId, costmap_doors.DoorRows],
    ) -> None:
        for level in self._scene.levels.values():
            if not has_costmap(self._scene, level):
                continue
            here = [self._on(level, doors) for doors in (happened, recorded)]
            if self._written == NOTHING_WRITTEN:
                colours = colours_of_costs(self._palette)
                self._writer.static((*level.path, COSTMAP), colours)
            for part in _parts(self._scene, level, here):
                self._write_part(level, part, *here)

    def _on(
        self, level: SceneLevel, doors: dict[DoorId, costmap_doors.DoorRows]
    ) -> dict[DoorId, costmap_doors.DoorRows]:
        """Return the rows of the doors that are on a level at some time."""
        return {
            door: rows
            for door, rows in doors.items()
            if level.level in self._scene.doors[door].lines
        }

    def _write_part(
        self,
        level: SceneLevel,
        part: _Part,
        happened: dict[DoorId, costmap_doors.DoorRows],
        recorded: dict[DoorId, costmap_doors.DoorRows],
    ) -> None:
        one, other = (
            dict(patches_along(doors, level.level, part.geometry, recorded=is_recorded))
            for doors, is_recorded in ((happened, False), (recorded, True))
        )
        for door in sorted(one.keys() | other.keys()):
            path = (*level.path, COSTMAP, *part.path, self._scene.doors[door].path[-1])
            along = (
                part.shown(patches.pop(door, _NOTHING), recorded=is_recorded).behind(self._written)
                for patches, is_recorded in ((one, False), (other, True))
            )
            is_line = self._scene.doors[door].shape.is_line
            order = ORDER_OF_LINES if is_line else ORDER_OF_AREAS
            self._write_door(path, part.geometry, *along, draw_order=order)

    def _write_door(
        self,
        path: EntityPath,
        geometry: GridGeometry,
        happened: DoorPatches,
        recorded: DoorPatches,
        *,
        draw_order: float,
    ) -> None:
        if not (len(happened.pictures) or len(recorded.pictures)):
            return
        order = rr.SegmentationImage.from_fields(opacity=1.0, draw_order=draw_order)
        self._writer.static(path, order)
        if happened.patches == recorded.patches and np.array_equal(
            happened.pictures, recorded.pictures
        ):
            self._write_pictures(path, happened, geometry, EVERYWHERE)
        else:
            self._write_pictures(path, happened, geometry, [HAPPENED])
            self._write_pictures(path, recorded, geometry, [RECORDED, EVENT])

    def _write_pictures(
        self,
        path: EntityPath,
        door: DoorPatches,
        geometry: GridGeometry,
        timelines: Sequence[str],
    ) -> None:
        pictures = door.pictures
        shows = pictures["patch"] != NO_PATCH
        self._writer.rows(
            path, pictures[shows], lambda part: _images(part, door.patches, geometry), timelines
        )
        self._writer.clear(path, pictures[~shows], timelines, returns=pictures[shows])


_NOTHING = DoorPatches([], np.empty(0, PICTURE))


@dataclass(frozen=True, slots=True)
class _Part:
    """The layer on one of a level's plans, and when it shows."""

    geometry: GridGeometry
    path: EntityPath
    """Relative to that of the layer."""
    happened: Sequence[TimeSpan] | None
    """None: at all times."""
    recorded: Sequence[TimeSpan] | None

    def shown(self, patches: DoorPatches, *, recorded: bool) -> DoorPatches:
        """Return what a door shows on that plan."""
        spans = self.recorded if recorded else self.happened
        return patches if spans is None else patches.within(spans, recorded=recorded)


def _parts(
    scene: Scene, level: SceneLevel, doors: Sequence[Mapping[DoorId, costmap_doors.DoorRows]]
) -> Iterator[_Part]:
    """Yield a part for each plan of a level that lies along its grid, or one for all times."""
    if level.plans.is_one:
        geometry = _geometry(level, [rows for one in doors for rows in one.values()])
        if geometry is not None:
            yield _Part(geometry, (), None, None)
        return
    spans = [_spans(scene, eras) for _, eras in eras_along(level)]
    for number, floor in _floors(level).items():
        if not floor.origin_theta:
            happened, recorded = (along.get(number, []) for along in spans)
            yield _Part(_grid_of(floor), (f"plan {number}",), happened, recorded)


def _spans(scene: Scene, eras: Sequence[PlanEra]) -> dict[int, list[TimeSpan]]:
    """Return in which spans each plan shows, by the number of its event."""
    spans: dict[int, list[TimeSpan]] = {}
    since = since_of(eras, scene)
    for era, begin, end in zip(eras, since, [*since[1:], None], strict=True):
        spans.setdefault(era.plan_event, []).append(TimeSpan(begin, end))
    return spans


def _floors(level: SceneLevel) -> dict[int, FloorMap]:
    """Return all plans of a level, by the numbers of their events."""
    eras = (*level.plans.happened, *level.plans.recorded)
    return {era.plan_event: era.floor for era in eras if era.floor is not None}


def has_costmap(scene: Scene, level: SceneLevel) -> bool:
    """Return whether a level has a layer to show: doors, and no rotated floor map."""
    floors = [level.floor] if level.plans.is_one else list(_floors(level).values())
    is_upright = any(floor is None or floor.origin_theta == 0 for floor in floors)
    return is_upright and any(level.level in door.lines for door in scene.doors.values())


def colours_of_costs(palette: Palette) -> Any:
    """Return the context that gives each cost its colour and its name; 255 is not drawn."""
    names = {FREE_SPACE: "free", INSCRIBED: "inscribed", LETHAL: "lethal"}
    colours = shades_of_costs(palette)
    return rr.AnnotationContext(
        [
            rr.AnnotationInfo(
                id=cost, label=f"{cost} {names.get(cost, '')}".strip(), color=colours[cost].tolist()
            )
            for cost in range(256)
        ]
    )


def shades_of_costs(palette: Palette) -> NDArray[np.uint8]:
    """Return a colour for each cost, uint8 (256, RGBA).

    A free cell is as an open door, a lethal one as a closed door; in between it runs from the
    first to the colour of an unknown one: dear, not blocked.
    """
    share = np.linspace(0.0, 1.0, INSCRIBED)[:, None]
    least, most = (np.array(colour, np.float64) for colour in (palette.open, palette.unknown))
    shades = np.empty((256, 4), np.uint8)
    shades[:INSCRIBED, :3] = np.round(least + share * (most - least))
    shades[INSCRIBED:, :3] = palette.closed
    shades[:, 3] = 255
    shades[NO_INFORMATION] = 0
    return shades


def _geometry(level: SceneLevel, doors: Iterable[costmap_doors.DoorRows]) -> GridGeometry | None:
    """Return the grid of the level's floor map, or one around its doors."""
    if level.floor is None:
        return costmap_doors.grid_around(doors, level.level)
    return _grid_of(level.floor)


def _grid_of(floor: FloorMap) -> GridGeometry:
    rows, columns = floor.cells.shape
    return GridGeometry.of_map((rows, columns), floor.resolution, (floor.origin_x, floor.origin_y))


def _images(
    part: Pictures, patches: Sequence[costmap_doors.Patch], geometry: GridGeometry
) -> Sequence[Any]:
    """Return the pictures, their first row lowest, and where they lie in metres."""
    looks = list(zip(part["patch"].tolist(), part["cost"].tolist(), strict=True))
    buffers = {look: patches[look[0]].costs(look[1]).tobytes() for look in set(looks)}
    formats = [_format(patch) for patch in patches]
    images = rr.SegmentationImage.columns(
        buffer=[buffers[look] for look in looks], format=[formats[patch] for patch, _ in looks]
    )
    cell = np.array([geometry.resolution, geometry.resolution, 1.0])
    origin = np.array([geometry.origin_x, geometry.origin_y, 0.0])
    corners = np.array([(patch.window.x0, patch.window.y0, 0) for patch in patches], np.float64)
    # A transform is one thing: what a row does not give of it is back at its default.
    places = rr.Transform3D.columns(
        translation=(origin + corners * cell)[part["patch"]], scale=np.tile(cell, (len(part), 1))
    )
    return [*images, *places]


def _format(patch: costmap_doors.Patch) -> Any:
    height, width = patch.window.shape
    return rr.components.ImageFormat(
        width=width, height=height, channel_datatype=rr.ChannelDatatype.U8
    )
