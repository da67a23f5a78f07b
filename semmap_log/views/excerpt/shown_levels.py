"""Where what is reported about level 0 is shown in a log that has levels, and 0 is none of them.

Such a log says so of poses, and of doors without a place, whose level nobody told.
"""

from __future__ import annotations

from collections.abc import Iterable


def home_of_0(levels: Iterable[int]) -> int | None:
    """Return the level on which level 0 is shown; None: on none, since nobody knows on which.

    Args:
        levels: Those that have a name, a floor map, or at some time a door with a place.
    """
    there = set(levels)
    if 0 in there or not there:
        return 0
    return there.pop() if len(there) == 1 else None
