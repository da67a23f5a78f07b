"""A building that is mapped again: the office's floor plan turned by a right angle, and shifted.

A right angle takes cells to cells, so that what a costmap must look like is known cell for cell,
by numpy's own turning of arrays.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import semmap_log as sl
from semmap_log.core.model.events import FloorMap
from semmap_log.interop.exporting.log_files import write_event_lines
from semmap_log.interop.importing.importing import import_file
from semmap_log.log.replay.replay import Scope

OFFICE = Path(__file__).parents[1] / "recordings" / "office"
SHIFT_M = (40.0, -7.5)
QUARTER = (*SHIFT_M, np.pi / 2)
"""From the office's map to the new one."""
MOVED_AT = "2026-03-02T14:00"


def turned(grid: NDArray[Any]) -> NDArray[Any]:
    """Return a grid, row 0 at the lowest y, as it lies after a quarter turn to the left."""
    return np.flipud(np.rot90(np.flipud(grid)))


def turned_floor(floor: FloorMap) -> FloorMap:
    """Return the map that somebody made anew: the same walls in the new frame."""
    top = floor.origin_y + floor.cells.shape[0] * floor.resolution
    return FloorMap(
        level=floor.level, resolution=floor.resolution, origin_x=SHIFT_M[0] - top,
        origin_y=SHIFT_M[1] + floor.origin_x, cells=np.ascontiguousarray(turned(floor.cells)),
    )  # fmt: skip


def write_map(floor: FloorMap, path: Path) -> Path:
    """Write a map as map_server has it; without our own writer."""
    grey = np.select([floor.cells == 100, floor.cells == 0], [0, 254], 205).astype(np.uint8)
    Image.fromarray(np.flipud(grey)).save(path.with_suffix(".png"))
    origin = [float(each) for each in (floor.origin_x, floor.origin_y, floor.origin_theta)]
    path.write_text(
        f"image: {path.with_suffix('.png').name}\nresolution: {floor.resolution!r}\n"
        f"origin: {origin}\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return path


def office_mapped_anew(folder: Path) -> Path:
    """Return the office's log, with a new map from 14:00 on; robots drive in its frame since."""
    old = sl.read(OFFICE)
    lines = folder / "office.jsonl"
    write_event_lines(old, lines, Scope())
    since_ns = old.instant(MOVED_AT)
    told = [json.loads(line) for line in lines.read_text().splitlines()]
    for event in told:
        happened = old.instant(event["happened"])
        if event["kind"] == "RobotPose" and happened >= since_ns:
            event["x"], event["y"] = SHIFT_M[0] - event["y"], SHIFT_M[1] + event["x"]
            event["theta"] = float(np.angle(np.exp(1j * (event["theta"] + np.pi / 2))))
    lines.write_text("".join(json.dumps(event) + "\n" for event in told))
    path = folder / "anew"
    with sl.create(path, tz="Europe/Vienna", robot="tinyRobot1", durability="none") as log:
        import_file(log, lines)
        log.rebase(turned_floor(old.floor_map()), by=QUARTER, at=MOVED_AT, reason="mapped anew")
    return path
