"""What to do with a log that has no events yet: told wherever there would be nothing to see."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from semmap_log.door_log import DoorLog

NOT_IN_THIS_PART = (
    "No door is in this part of the log. To see more of it, leave out --from, --to or --door."
)


def how_to_begin(log: DoorLog) -> str | None:
    """Return what to type to fill an empty log; None: it has events."""
    if next(log.commits(), None) is not None:
        return None
    place = shlex.quote(str(log.path))
    return (
        "The log has no events yet. To begin, one of:\n"
        f"  semmap-log import {place} FILE   # a building, a door database, a CSV, a bag\n"
        f"  semmap-log add {place} --x 2 --y 1.5 --theta 0 --width 0.9 --name front\n"
        f"  semmap-log record {place}   # events as JSON lines, or from ROS"
    )
