"""`show`: one event, with all that is known about it."""

from __future__ import annotations

from typing import Annotated

import typer

from semmap_log.cli.common import AsJson, LogPath, console, print_json


def run(
    log: LogPath,
    number: Annotated[int, typer.Argument(metavar="N", min=0, help="The event's number.")],
    *,
    as_json: AsJson = False,
) -> None:
    """Show one event: its fields, when it happened and was recorded, who and why.

    \b
    Example:
      semmap-log show office 42
    """
    from semmap_log.interop.formats.json.door_json import entry_to_json
    from semmap_log.log import read

    opened = read(log)
    entry = opened.entry(number)
    if as_json:
        print_json(entry_to_json(entry))
        return
    from semmap_log.views.tables import entry_table

    name = "" if entry.door_id is None else opened.door_names().get(entry.door_id, "")
    console().print(entry_table(entry, tz=opened.info.timezone, name=name))
