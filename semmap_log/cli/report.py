"""`report`: the history as one page, for who installs nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from semmap_log.cli import common


def run(
    log: common.LogPath,
    out: Annotated[
        Path, typer.Argument(metavar="OUT.html", help="The page.", callback=common.a_file)
    ],
    *,
    since: common.Since = None,
    until: common.Until = None,
    door: Annotated[
        list[str] | None, typer.Option("--door", metavar="DOOR", help="Only this one; repeatable.")
    ] = None,
    object_class: common.OfClass = None,
    tz: Annotated[
        str | None, typer.Option("--tz", metavar="ZONE", help="Of all times; default: the log's.")
    ] = None,
    palette: common.PaletteChoice = common.PaletteName.default,
    as_json: common.AsJson = False,
) -> None:
    """Write the history as one page for any browser, nothing else needed.

    A floor plan with a time slider, state lanes, a table of the doors, typical weeks, the last
    changes, the health of the log. The page needs no network, and prints. At each moment its
    doors are those of `semmap-log replay --at`. The same log makes the same page, byte for byte;
    an old file of that name is replaced at once. Retracted events are left out.

    \b
    Examples:
      semmap-log report office office.html
      semmap-log report office monday.html --since 2026-03-02 --until 2026-03-03
      semmap-log report office two.html --door front --palette colour-blind
    """
    from semmap_log.core.texts import counted
    from semmap_log.interop.exporting.html_report import write_report
    from semmap_log.log import read

    opened = read(log)
    common.print_empty_log_hint(opened)
    start, end = common.range_of(opened, since, until)
    doors = common.doors_meant(opened, door, object_class)
    with common.progress("Reading") as told:
        done = write_report(
            opened,
            out,
            since=start,
            until=end,
            doors=doors,
            tz=tz,
            palette=palette.colours,
            progress=told,
        )
    if as_json:
        common.print_json({"file": str(out), "doors": done.doors, "events": done.events,
                    "bytes": done.bytes})  # fmt: skip
        return
    shown = f"{counted(done.doors, 'door')}, {counted(done.events, 'event')}"
    common.say(f"{out}: {shown}, {common.size_of(done.bytes)}.")
