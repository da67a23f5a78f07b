"""A simulated patrol as a picture, so that a person can check it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from patrol_sim.laser_surfaces import Floats, Lines, Surface
from patrol_sim.laser_world import Patrol, SimScan

INK = {
    Surface.PAINT: (60, 60, 60), Surface.WOOD: (150, 90, 30), Surface.DARK: (0, 0, 0),
    Surface.SHINY: (110, 110, 170), Surface.CLOTH: (200, 0, 200), Surface.GLASS: (0, 170, 220),
}  # fmt: skip
WAY, POINT, DRAWN = (120, 200, 120), (220, 30, 30), (255, 160, 0)


@dataclass(frozen=True, slots=True)
class Window:
    """What part of the floor, and how large."""

    low: Floats
    high: Floats
    pixels_per_m: float

    def xy(self, points: Floats) -> list[tuple[float, float]]:
        scaled = (points - self.low) * self.pixels_per_m
        tall = (self.high[1] - self.low[1]) * self.pixels_per_m
        return [(float(x), float(tall - y)) for x, y in scaled]

    @property
    def size(self) -> tuple[int, int]:
        wide, tall = (self.high - self.low) * self.pixels_per_m
        return max(1, round(wide)), max(1, round(tall))


def whole(patrol: Patrol, *, width: int = 1600) -> Window:
    """Return a window on the whole level."""
    ends = patrol.still.ends.reshape(-1, 2)
    low, high = ends.min(axis=0) - 0.5, ends.max(axis=0) + 0.5
    return Window(low, high, width / float(high[0] - low[0]))


def around(middle: Floats, reach_m: float, *, width: int = 700) -> Window:
    """Return a window on a place."""
    return Window(middle - reach_m, middle + reach_m, width / (2 * reach_m))


def drawn(
    patrol: Patrol, window: Window, *, at_s: float, scans: Iterable[SimScan] = (),
    believed: Floats | None = None,
) -> Image.Image:  # fmt: skip
    """Return the world at a moment, the robot's way, and where scans ended.

    Args:
        patrol: What took place.
        window: What to show.
        at_s: When leaves stood so.
        scans: Whose beams' ends are shown.
        believed: (n, 3) the robot's poses at the times of the track, as it believed; None: where it
            really was.
    """
    image = Image.new("RGB", window.size, (255, 255, 255))
    pen = ImageDraw.Draw(image)
    way = patrol.track.poses[:, :2]
    pen.line(window.xy(way[::10]), fill=WAY, width=2)
    for life in patrol.lives.values():
        pen.line(window.xy(np.array(life.body.drawn.ends)), fill=DRAWN, width=2)
    _draw_lines(pen, window, patrol.lines_at(at_s))
    for scan in scans:
        for x, y in window.xy(beam_ends(patrol, scan, believed)):
            pen.ellipse((x - 1.5, y - 1.5, x + 1.5, y + 1.5), fill=POINT)
    for life in patrol.lives.values():
        (x, y), *_ = window.xy(np.mean(life.body.drawn.ends, axis=0)[None])
        pen.text((x + 4, y + 4), f"{life.body.drawn.door_id}", fill=(0, 0, 200))
    return image


def beam_ends(patrol: Patrol, scan: SimScan, believed: Floats | None = None) -> Floats:
    """Return where the beams that came back ended, (k, 2) m."""
    times_s = patrol.beam_times_s(scan.at_s)
    poses = patrol.track.poses if believed is None else believed
    base = np.stack([np.interp(times_s, patrol.track.times_s, column) for column in poses.T], -1)
    beams = patrol.laser.placed(base, as_told=believed is not None)
    back = np.isfinite(scan.ranges)
    ends: Floats = beams.origins[back] + scan.ranges[back, None] * beams.to[back]
    return ends


def _draw_lines(pen: ImageDraw.ImageDraw, window: Window, lines: Lines) -> None:
    for row, surface in zip(lines.ends, lines.surface, strict=True):
        pen.line(window.xy(row.reshape(2, 2)), fill=INK[Surface(surface)], width=1)
