"""`annotate`: a remark about a door, in words.

`tell` prints the answer of every command that writes: the numbers of the events that it stored.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import AsJson, DoorName, WritableLog, print_json, takes_about

if TYPE_CHECKING:
    from semmap_log.log.door_log.appender import Appended
    from semmap_log.log.door_log.door_log_writer import About


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
    import semmap_log as sl

    with sl.append(log) as opened:
        appended = opened.annotate(door, key, value, **about)
    tell(appended, as_json=as_json)


def tell(appended: Appended, *, as_json: bool, **more: Any) -> None:
    """Print which event a command became."""
    first, count = appended.first_event, appended.count
    if as_json:
        print_json({"event": first, "count": count, "repeated": appended.repeated, **more})
        return
    numbers = str(first) if count == 1 else f"{first}..{first + count - 1}"
    known = " (stored before; nothing was written now)" if appended.repeated else ""
    typer.echo(f"event {numbers}{known}")
