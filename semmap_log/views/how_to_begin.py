"""What to do with a log that has no events yet: told wherever there would be nothing to see."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from semmap_log.core.texts import command_line

if TYPE_CHECKING:
    from semmap_log.log.door_log.door_log import DoorLog

NOT_IN_THIS_PART = (
    "No door is in this part of the log. To see more of it, leave out --since, --until or --door."
)


def how_to_begin(log: DoorLog) -> str | None:
    """Return what to type to fill an empty log; None: it has events."""
    if log.last_event() >= 0:
        return None
    line = partial(_line, log)
    return (
        "The log has no events yet. To begin, one of:\n"
        f"  {line('import')} FILE   # a building, a door database, a CSV, a bag\n"
        f"  {line('add')} --x 2 --y 1.5 --theta 0 --width 0.9 --name front\n"
        f"  {line('record')}   # events as JSON lines, or from ROS"
    )


def _line(log: DoorLog, verb: str) -> str:
    return command_line(verb, log.path)
