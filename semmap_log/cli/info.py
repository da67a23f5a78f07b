"""`info`: what a log holds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from semmap_log.cli.common import AsJson, console, print_json, progress


def run(
    log: Annotated[
        Path, typer.Argument(metavar="LOG", help="The log's folder, or one of its .mcap files.")
    ],
    *,
    as_json: AsJson = False,
) -> None:
    """Show what a log holds: doors, events by kind, time spans, files, and what looks wrong.

    \b
    Examples:
      semmap-log info office
      semmap-log info office/office_000000.mcap --json
    """
    from semmap_log.summary import open_any, summarize
    from semmap_log.views.health import head_hint
    from semmap_log.views.tables import summary_table

    with progress("Reading") as told:
        summary = summarize(open_any(log), progress=told)
    if as_json:
        print_json(_to_json(summary))
    else:
        console().print(summary_table(summary))
        console().print(head_hint(str(log)))


def _to_json(summary: Any) -> dict[str, Any]:
    from semmap_log.moments import format_utc

    def span(times: tuple[int, int] | None) -> list[str] | None:
        return None if times is None else [format_utc(time) for time in times]

    return {
        "log_id": summary.info.log_id,
        "timezone": summary.info.timezone,
        "building": summary.info.building,
        "robot": summary.info.robot,
        "doors": len(summary.door_map.doors),
        "events": summary.events,
        "commits": summary.commits,
        "kinds": summary.counts,
        "happened": span(summary.happened_ns),
        "recorded": span(summary.recorded_ns),
        "head": summary.head.hex(),
        "durability": summary.durability,
        "bytes": summary.bytes,
        "segments": [
            {
                "file": segment.path.name,
                "bytes": len(segment.file),
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
