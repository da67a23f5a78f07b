"""Stretches of time for axes, in every zone: around changes of its clocks, and anywhere else."""

from __future__ import annotations

import random
from dataclasses import dataclass
from datetime import datetime, timezone
from functools import cache
from importlib import resources
from zoneinfo import available_timezones

from semmap_log.views.zone_times import Span, zone_offsets

MINUTE, HOUR, DAY = 60_000, 3_600_000, 86_400_000
LENGTHS = (3 * MINUTE, 40 * MINUTE, 3 * HOUR, 5 * HOUR, 14 * HOUR, DAY, 3 * DAY, 9 * DAY, 40 * DAY,
           200 * DAY, 800 * DAY, 3650 * DAY)  # fmt: skip
LETTERS = (50.0, 80.0, 160.0, 400.0)
"""Of a telephone, a narrow window, a desk, and one of many."""
BEGIN, FIRST, LAST, END = (int(datetime(year, 1, 1, tzinfo=timezone.utc).timestamp()) * 1000
                           for year in (1998, 2009, 2029, 2040))  # fmt: skip
"""Axes are around a moment between the middle two; so the offsets reach ten years farther."""
LATEST_CHANGES = 4


@dataclass(frozen=True)
class Axis:
    """A zone and what is shown of it."""

    tz: str
    offsets: list[tuple[int, int]]
    start_ms: int
    end_ms: int
    letters: float
    short: bool


@cache
def axes() -> list[Axis]:
    """Return axes of all zones; of zones that are the same by other names, of one."""
    rng, found = random.Random(17), []
    for tz in _different_zones():
        offsets = zone_offsets(Span(BEGIN, END), tz)
        changes = [ms for ms, _ in offsets[1:] if FIRST <= ms < LAST]
        for middle_ms in [*changes[:1], *changes[-LATEST_CHANGES:], rng.randrange(FIRST, LAST)]:
            for length_ms in rng.sample(LENGTHS, 4):
                start_ms = middle_ms - rng.randrange(length_ms)
                letters, short = rng.choice(LETTERS), rng.random() < 0.3
                found.append(Axis(tz, offsets, start_ms, start_ms + length_ms, letters, short))
    return found


def _different_zones() -> list[str]:
    root = resources.files("tzdata").joinpath("zoneinfo")
    names = {root.joinpath(tz).read_bytes(): tz
             for tz in available_timezones() if root.joinpath(tz).is_file()}  # fmt: skip
    return sorted(names.values())
