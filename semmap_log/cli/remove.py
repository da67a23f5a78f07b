"""`remove`: a door leaves the map."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semmap_log.cli.common import AsJson, DoorName, WritableLog, takes_about

if TYPE_CHECKING:
    from semmap_log.log import About


@takes_about
def run(log: WritableLog, door: DoorName, *, as_json: AsJson = False, about: About) -> None:
    """Take a door out of the map; its history stays, its id is never used again.

    \b
    Example:
      semmap-log remove office 3 --actor survey --reason "walled up"
    """
    from semmap_log.cli.door_options import tell
    from semmap_log.log import append

    with append(log) as opened:
        appended = opened.remove_door(door, **about)
    tell(appended, as_json=as_json)
