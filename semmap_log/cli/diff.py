"""`diff`: what is different between two moments."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import AsJson, LogPath, console, print_json, range_of
from semmap_log.core.texts import command_line

if TYPE_CHECKING:
    from semmap_log.core.model.moments import Time
    from semmap_log.log import DoorLog


def run(
    log: LogPath,
    first: Annotated[
        str | None, typer.Argument(metavar="T1", help="The earlier moment; or both, as T1..T2.")
    ] = None,
    second: Annotated[
        str | None, typer.Argument(metavar="T2", help="The later moment; default: now.")
    ] = None,
    *,
    since: Annotated[
        str | None, typer.Option("--since", metavar="TIME", help="The same as T1; or T1..T2.")
    ] = None,
    until: Annotated[
        str | None, typer.Option("--until", metavar="TIME", help="The same as T2.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Show the doors added, removed and changed between two moments, and the events that did it.

    The events are those with T1 < happened <= T2, so that T2 is inside: at T1 and at T2 `replay`
    shows the two states. T1 can be --since, and T2 --until, as other verbs have them.

    JSON also names what the table leaves out: when and by which event doors were last heard of, and
    levels; so that the state at T1 and the diff give all of the state at T2.

    \b
    Examples:
      semmap-log diff office "yesterday 08:00" "yesterday 20:00"
      semmap-log diff office yesterday..now
      semmap-log diff office --since yesterday
      semmap-log diff office event:100 event:200 --json
    """
    from semmap_log.interop.formats.json.door_json import diff_to_json
    from semmap_log.log import read

    _check_moments(log, first, second, since, until)
    opened = read(log)
    start, end = _ends(opened, first or since, second or until)
    found = opened.diff(start, end)
    if as_json:
        print_json(diff_to_json(found))
        return
    from semmap_log.views.tables import diff_table

    console().print(diff_table(found, tz=opened.info.timezone))


def _check_moments(
    log: Path, first: str | None, second: str | None, since: str | None, until: str | None
) -> None:
    """Refuse a moment that is given in two ways, and a range that does not say where it begins.

    Raises:
        typer.BadParameter: It is.
    """
    for place, option, name in ((first, since, "--since"), (second, until, "--until")):
        if place is not None and option is not None:
            raise typer.BadParameter(f"{place} says that already; leave one out", param_hint=name)
    if first is not None and ".." in first and (second or until):
        raise typer.BadParameter(f"{first} names both ends; leave T2 out", param_hint="T2")
    if first is None and since is None:
        from semmap_log.core.io.url_path import place_of

        line = command_line("diff", place_of(log), "yesterday")
        raise typer.BadParameter(f"expected the earlier moment, as in: {line}", param_hint="T1")


def _ends(log: DoorLog, first: str | None, second: str | None) -> tuple[Time, Time]:
    start, end = range_of(log, first, second)
    return start, "now" if end is None else end
