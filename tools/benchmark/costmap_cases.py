"""The costmap's cases."""

from __future__ import annotations

from collections.abc import Iterator

from benchmark.case import Case
from benchmark.costmap_changes import change_case
from benchmark.costmap_day import day_case
from benchmark.costmap_lines import lines_case
from benchmark.costmaps import PART, rebuild_case
from benchmark.logs import Workshop

SIDE = 4000
"""Cells along each edge of the large map: 200 m."""


def costmap_cases(shop: Workshop, rounds: int | None, *, tries_out: bool = False) -> Iterator[Case]:
    """Yield: the whole map; the lines of all doors; a door's change; a day of changes.

    Args:
        shop: Told what is being made.
        rounds: Rounds that count; None: each case's own.
        tries_out: Only the corner of the map, to see whether everything works.
    """
    side = PART if tries_out else SIDE
    shop.say("drawing a costmap by plain loops, to compare with")
    yield rebuild_case(side, rounds)
    yield lines_case(side, rounds)
    yield change_case(side, rounds)
    yield day_case(shop, side, rounds, tries_out=tries_out)
