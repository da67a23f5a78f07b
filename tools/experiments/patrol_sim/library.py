"""Two weeks of a small library as files of a user's own: sightings in a CSV, and a floor plan.

`docs/tutorial.md` begins with these files. They are made without semmap-log.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

CELL_M = 0.1
WIDTH_M, HEIGHT_M, MARGIN_M = 20.0, 12.0, 1.0
FLOOR, WALL, OUTSIDE = 254, 0, 205
WALLS_M = (
    (0.0, 0.0, 20.0, 0.0), (0.0, 12.0, 20.0, 12.0), (0.0, 0.0, 0.0, 12.0), (20.0, 0.0, 20.0, 12.0),
    (0.0, 5.0, 20.0, 5.0), (0.0, 7.0, 20.0, 7.0), (11.0, 7.0, 11.0, 12.0), (13.0, 0.0, 13.0, 5.0),
)  # fmt: skip
"""The hall lies between y = 5 and y = 7; two rooms above it, two below."""
DOORS_M = {
    "entrance": (0.0, 5.4, 0.0, 6.6),
    "reading_room": (5.0, 7.0, 6.2, 7.0),
    "archive": (14.0, 7.0, 14.9, 7.0),
    "staff": (9.0, 5.0, 9.9, 5.0),
}
"""The two ends of each door."""
MONDAY = datetime(2026, 3, 2, tzinfo=ZoneInfo("Europe/Vienna"))
DAYS = (0, 1, 2, 3, 4, 5, 7, 8, 9, 10, 11, 12)
"""On Sundays the robot stands on its charger."""
ROUNDS = range(7, 20)
LOOK_AFTER_S = {"entrance": 10, "staff": 50, "archive": 70, "reading_room": 100}
ACCURACY = 0.95
MISREAD = ("archive", 10, 13)
"""On the second Thursday at 13 hours a trolley stands in the open door of the archive."""


def write_files(folder: Path, *, seed: int) -> None:
    """Write sightings.csv, plan.pgm and plan.yaml; what is there is replaced."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = "".join(f"{line}\n" for line in _sightings(random.Random(f"library {seed}")))
    (folder / "sightings.csv").write_text(f"timestamp,door,state,accuracy\n{lines}")
    cells = _plan()
    height, width = cells.shape
    (folder / "plan.pgm").write_bytes(f"P5\n{width} {height}\n255\n".encode() + cells.tobytes())
    corner_m = -MARGIN_M - CELL_M / 2  # so that walls run through the middles of cells
    (folder / "plan.yaml").write_text(
        f"image: plan.pgm\nresolution: {CELL_M}\norigin: [{corner_m}, {corner_m}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def _sightings(rng: random.Random) -> Iterator[str]:
    for day in DAYS:
        for hour in ROUNDS:
            for door, after_s in LOOK_AFTER_S.items():
                at = MONDAY + timedelta(days=day, hours=hour, minutes=2, seconds=after_s)
                is_open = _is_open(door, day % 7, hour, rng)
                is_right = rng.random() < ACCURACY
                if (door, day, hour) == MISREAD:
                    is_open, is_right = True, False
                state = "open" if is_open == is_right else "closed"
                yield f"{at:%Y-%m-%dT%H:%M:%S},{door},{state},{ACCURACY}"


def _is_open(door: str, weekday: int, hour: int, rng: random.Random) -> bool:
    """Return whether a door is open at an hour: as usual, or as chance has it."""
    match door:
        case "entrance":
            usual = 8 <= hour < 18 if weekday < 5 else 9 <= hour < 13
        case "reading_room":
            usual = weekday < 5 and 9 <= hour < 17
        case "archive":
            usual = (weekday == 1 and 9 <= hour < 12) or (weekday == 3 and 12 <= hour < 16)
        case _:
            usual = weekday < 5 and 8 <= hour < 16 and rng.random() < 0.3
    return usual if rng.random() < 0.97 else not usual


def _plan() -> NDArray[np.uint8]:
    """Return the picture of the plan, its first row on top."""
    rows, columns = (round((size + 2 * MARGIN_M) / CELL_M) for size in (HEIGHT_M, WIDTH_M))
    cells = np.full((rows, columns), OUTSIDE, np.uint8)
    cells[_places(0.0, 0.0, WIDTH_M, HEIGHT_M)] = FLOOR
    for wall in WALLS_M:
        cells[_places(*wall)] = WALL
    for x0, y0, x1, y1 in DOORS_M.values():  # their ends stand in the wall
        along_x, along_y = (CELL_M if end > start else 0.0 for start, end in ((x0, x1), (y0, y1)))
        cells[_places(x0 + along_x, y0 + along_y, x1 - along_x, y1 - along_y)] = FLOOR
    return cells[::-1]


def _places(x0: float, y0: float, x1: float, y1: float) -> tuple[slice, slice]:
    """Return rows and columns of the cells from one corner to the other, both included."""
    left, right, low, high = (round((edge + MARGIN_M) / CELL_M) for edge in (x0, x1, y0, y1))
    return slice(low, high + 1), slice(left, right + 1)
