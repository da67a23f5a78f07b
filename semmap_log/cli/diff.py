"""`diff`: what is different between two moments."""

from __future__ import annotations

from typing import Annotated

import typer

from semmap_log.cli.common import AsJson, LogPath, console, print_json


def run(
    log: LogPath,
    first: Annotated[
        str, typer.Argument(metavar="T1", help="The earlier moment; or both, as T1..T2.")
    ],
    second: Annotated[str, typer.Argument(metavar="T2", help="The later moment.")] = "now",
    *,
    as_json: AsJson = False,
) -> None:
    """Show the doors added, removed and changed between two moments, and the events that did it.

    The events are those with T1 < happened <= T2. JSON also names what the table leaves out: when
    and by which event doors were last heard of, and levels; so that the state at T1 and the diff
    give all of the state at T2.

    \b
    Examples:
      semmap-log diff office "yesterday 08:00" "yesterday 20:00"
      semmap-log diff office yesterday..now
      semmap-log diff office event:100 event:200 --json
    """
    import semmap_log as sl
    from semmap_log.formats.door_json import diff_to_json
    from semmap_log.views.tables import diff_table

    opened = sl.read(log)
    start, end = opened.span(first) if ".." in first else (first, second)
    found = opened.diff(start, end)
    if as_json:
        print_json(diff_to_json(found))
    else:
        console().print(diff_table(found, tz=opened.info.timezone))
