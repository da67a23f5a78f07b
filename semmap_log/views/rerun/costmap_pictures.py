"""The costmap's door layer into a rerun recording: a small picture a door, of costs.

A whole grid at each change would be gigabytes; a door's cells are some twenty. The pictures hold
the costs themselves, so that hovering over a cell tells them, and get their colours from a context.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.costmap_2d.costs import FREE_SPACE, INSCRIBED, LETHAL, NO_INFORMATION
from semmap_log.costmap_2d.grid import GridGeometry
from semmap_log.domain.doors import DoorId
from semmap_log.views.palette import Palette
from semmap_log.views.rerun.costmap_cells import Patch, grid_around
from semmap_log.views.rerun.costmap_doors import DoorRows
from semmap_log.views.rerun.costmap_rows import (
    NO_PATCH,
    PICTURE,
    DoorPatches,
    Pictures,
    patches_along,
)
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.rows import EVENT, EVERYWHERE, HAPPENED, RECORDED, RowWriter
from semmap_log.views.rerun.scene import EntityPath, Scene, SceneLevel

COSTMAP = "costmap"

NOTHING_WRITTEN = -2
"""Less than any event's number; -1 is what a recording begins with."""


class CostmapWriter:
    """Takes what happens to doors, and writes the layers of all levels when told that it is all.

    More may come behind it, if none of it is late. A level whose floor map is turned against its
    grid has no costmap.
    """

    def __init__(self, writer: RowWriter, scene: Scene, palette: Palette) -> None:
        self._writer = writer
        self._scene = scene
        self._palette = palette
        self._pieces: dict[str, dict[DoorId, list[DoorRows]]] = {HAPPENED: {}, RECORDED: {}}
        self._has_news = False
        self._written = NOTHING_WRITTEN

    def take(self, door: DoorId, rows: DoorRows, timelines: Sequence[str]) -> None:
        """Take a door's next rows along these timelines; `event` goes with `recorded`."""
        for timeline, pieces in self._pieces.items():
            if timeline in timelines and len(rows):
                pieces.setdefault(door, []).append(rows)
                self._has_news = True

    def finish(self) -> None:
        """Write what is new of all layers."""
        if not self._has_news:
            return
        joined = {
            timeline: {door: DoorRows.joined(rows) for door, rows in sorted(pieces.items())}
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

    def _write(self, happened: dict[DoorId, DoorRows], recorded: dict[DoorId, DoorRows]) -> None:
        for level in self._scene.levels.values():
            if not has_costmap(self._scene, level):
                continue
            here = [self._on(level, doors) for doors in (happened, recorded)]
            geometry = _geometry(level, [rows for doors in here for rows in doors.values()])
            if geometry is not None:
                self._write_level(level, geometry, *here)

    def _on(self, level: SceneLevel, doors: dict[DoorId, DoorRows]) -> dict[DoorId, DoorRows]:
        """Return the rows of the doors that are on a level at some time."""
        return {
            door: rows
            for door, rows in doors.items()
            if level.level in self._scene.doors[door].lines
        }

    def _write_level(
        self,
        level: SceneLevel,
        geometry: GridGeometry,
        happened: dict[DoorId, DoorRows],
        recorded: dict[DoorId, DoorRows],
    ) -> None:
        if self._written == NOTHING_WRITTEN:
            self._writer.static((*level.path, COSTMAP), colours_of_costs(self._palette))
        one = dict(patches_along(happened, level.level, geometry, recorded=False))
        other = dict(patches_along(recorded, level.level, geometry, recorded=True))
        for door in sorted(one.keys() | other.keys()):
            path = (*level.path, COSTMAP, self._scene.doors[door].path[-1])
            along = (patches.pop(door, _NOTHING).behind(self._written) for patches in (one, other))
            self._write_door(path, geometry, *along)

    def _write_door(
        self, path: EntityPath, geometry: GridGeometry, happened: DoorPatches, recorded: DoorPatches
    ) -> None:
        if not (len(happened.pictures) or len(recorded.pictures)):
            return
        self._writer.static(path, rr.SegmentationImage.from_fields(opacity=1.0, draw_order=-5.0))
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


def has_costmap(scene: Scene, level: SceneLevel) -> bool:
    """Tell whether a level has a layer to show: doors, and no floor map that is turned."""
    is_turned = level.floor is not None and level.floor.origin_theta != 0
    return not is_turned and any(level.level in door.lines for door in scene.doors.values())


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


def _geometry(level: SceneLevel, doors: Iterable[DoorRows]) -> GridGeometry | None:
    """Return the grid of the level's floor map, or one around its doors."""
    floor = level.floor
    if floor is None:
        return grid_around(doors, level.level)
    rows, columns = floor.cells.shape
    return GridGeometry.of_map((rows, columns), floor.resolution, (floor.origin_x, floor.origin_y))


def _images(part: Pictures, patches: Sequence[Patch], geometry: GridGeometry) -> Sequence[Any]:
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


def _format(patch: Patch) -> Any:
    height, width = patch.window.shape
    return rr.components.ImageFormat(
        width=width, height=height, channel_datatype=rr.ChannelDatatype.U8
    )
