"""`info`: what a log holds."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from semmap_log.cli.common import AnyLogPath, AsJson, console, print_json, progress, say

MOST_DOORS = 16
"""Of a day, unless all are wanted."""


def run(
    log: AnyLogPath,
    *,
    day: Annotated[
        str | None,
        typer.Option(
            "--day",
            metavar="TIME",
            help="The day whose states are drawn; default: that of the last report.",
        ),
    ] = None,
    all_doors: Annotated[
        bool, typer.Option("--all-doors", help="Draw every door, not only the liveliest.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Show what a log holds: doors, events by kind, time spans, files, and what looks wrong.

    And a day of the doors, half hour by half hour: the higher a bar, the longer it was open.

    \b
    Examples:
      semmap-log info office
      semmap-log info office --day yesterday --all-doors
      semmap-log info office/office_000000.mcap --json
    """
    from semmap_log.analysis.day import day_of_doors
    from semmap_log.core.io.url_path import place_of
    from semmap_log.core.io.virtual_logs import has_virtual_suffix
    from semmap_log.interop.formats.json.door_json import day_to_json
    from semmap_log.log import open_any, read

    with progress("Reading") as told:
        summary = open_any(log).summary(progress=told)
    # A single file has no day: what the files before it have is not there.
    has_days = log.suffix != ".mcap" and summary.events and summary.is_understood
    drawn = day_of_doors(read(log), day) if has_days else None
    if as_json:
        print_json({**_to_json(summary), "day": None if drawn is None else day_to_json(drawn)})
        return
    from semmap_log.views.day_chart import day_chart
    from semmap_log.views.health import head_hint
    from semmap_log.views.tables import summary_table

    out = console()
    out.print(summary_table(summary))
    if drawn is not None and drawn.doors:
        out.print()
        out.print(day_chart(drawn, None if all_doors else MOST_DOORS))
        out.print()
    elif day is not None:
        say(f"--day {day}: no door was in the map on that day, or the file is not a whole log.")
    if not has_virtual_suffix(log):  # a join has a view for each state of its logs
        out.print(head_hint(place_of(log)))


def _to_json(summary: Any) -> dict[str, Any]:
    from dataclasses import fields

    from semmap_log.core.model.moments import format_utc

    def span(times: tuple[int, int] | None) -> list[str] | None:
        return None if times is None else [format_utc(time) for time in times]

    return {
        "log_id": summary.info.log_id,
        "timezone": summary.info.timezone,
        "building": summary.info.building,
        "robot": summary.info.robot,
        "holds": summary.info.holds,
        "doors": len(summary.door_map.doors),
        "events": summary.events,
        "commits": summary.commits,
        "kinds": summary.counts,
        "happened": span(summary.happened_ns),
        "recorded": span(summary.recorded_ns),
        "head": summary.head.hex(),
        "durability": summary.durability,
        "personal_data": {
            f.name: getattr(summary.personal, f.name) for f in fields(summary.personal)
        },
        "bytes": summary.bytes,
        "index": None if summary.index is None else _index_to_json(summary.index),
        "segments": [
            {
                "file": segment.path.name,
                "bytes": segment.size,
                "closed": segment.closed,
                "first_event": segment.header.first_event,
                "torn_bytes": segment.torn_bytes,
            }
            for segment in summary.segments
        ],
        "suspects": [
            {
                "event": suspect.event,
                "wall_clock": format_utc(suspect.wall_clock_ns),
                "why": suspect.why,
            }
            for suspect in summary.suspects
        ],
        "warnings": summary.warnings,
    }


def _index_to_json(index: Any) -> dict[str, int]:
    return {"segments": index.segments, "indexed": index.indexed, "bytes": index.size}
