"""On which level to show what belongs to level 0, in a log whose levels do not include 0.

In such a log, level 0 means an unknown level: of poses, and of doors without a place.
"""

from __future__ import annotations

from collections.abc import Iterable


def home_of_0(levels: Iterable[int]) -> int | None:
    """Return the level on which level 0 is shown; None: unknown, so it is not shown.

    Args:
        levels: Those that have a name, a floor map, or at some time a door with a place.
    """
    there = set(levels)
    if 0 in there or not there:
        return 0
    return there.pop() if len(there) == 1 else None
