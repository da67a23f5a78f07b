"""`annotate`: a remark about a door, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import AsJson, DoorName, WritableLog, takes_about
from semmap_log.cli.door_options import tell

if TYPE_CHECKING:
    from semmap_log.log import About


@takes_about
def run(
    log: WritableLog,
    door: DoorName,
    key: Annotated[str, typer.Argument(metavar="KEY", help="name, rooms, kind, or your own.")],
    value: Annotated[
        str, typer.Argument(metavar="VALUE", help="What is said; an empty text takes it back.")
    ],
    *,
    as_json: AsJson = False,
    about: About,
) -> None:
    """Say something about a door: its name, the rooms it joins, its kind.

    \b
    Examples:
      semmap-log annotate office 3 name front
      semmap-log annotate office front rooms "lobby,corridor"
      semmap-log annotate office front rooms ""
    """
    from semmap_log.log import append

    with append(log) as opened:
        appended = opened.annotate(door, key, value, **about)
    tell(appended, as_json=as_json)
