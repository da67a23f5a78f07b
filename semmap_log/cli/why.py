"""`why`: what was true of a door, what was believed, since when, and who reported it."""

from __future__ import annotations

from typing import Annotated

import typer

from semmap_log.cli import common


def run(
    log: common.LogPath,
    door: common.DoorName,
    *,
    at: Annotated[
        str | None, typer.Option("--at", metavar="TIME", help="The moment; default: now.")
    ] = None,
    known_at: common.KnownAt = None,
    near: Annotated[
        str, typer.Option("--near", metavar="DURATION", help="What says otherwise: so near to it.")
    ] = "10min",
    as_json: common.AsJson = False,
) -> None:
    """Show why a door was in a state: what was true, what was believed, and who reported it.

    "True" is by all that is known today, "believed" by what had been recorded by then, or by
    --known-at. Where they differ, the event that made the difference is named: one that was
    recorded later, or retracted later.

    Events that report another state count from where the state began, at the least from --near
    before the moment, up to as long after it: readings that were taken back, requests, robots
    that gave up, another sensor. P(open) is what could be known then.

    \b
    Times: 2026-03-01T14:02 (the log's zone), …Z, @1772373720, 2h ago,
    yesterday 14:00, now (counted from the log's end), 14:00, Tue 10:00 (the last
    ones), event:1234.

    \b
    Examples:
      semmap-log why office front
      semmap-log why office front --at "yesterday 14:00"
      semmap-log why office front --at event:58
      semmap-log why office L1/front --at 2026-03-01T14:02 --near 1h --json
    """
    from semmap_log.core.model.moments import parse_duration
    from semmap_log.interop.formats.json.explanation_json import explanation_to_json
    from semmap_log.log import read

    opened = read(log)
    common.print_empty_log_hint(opened)
    with common.progress("Reading") as told:
        found = opened.why(door, at, known_at, near_ns=parse_duration(near), progress=told)
    if as_json:
        common.print_json(explanation_to_json(found))
        return
    from semmap_log.views.timeline_table import explanation_table

    common.console().print(explanation_table(found, tz=opened.info.timezone))
    if found.true.state is None:
        common.note_later_events(opened, at, known_at, door=found.door_id)
