"""`index`: tables next to a log in which one door's events lie together."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from semmap_log.cli.common import AsJson, WritableLog, print_json, progress
from semmap_log.core.texts import counted


def run(
    log: WritableLog,
    *,
    anew: Annotated[
        bool, typer.Option("--anew", help="Make all tables again, also those that are good.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Make a log quick to ask about single doors: tables of its closed segments, sorted by door.

    They lie in LOG/index, made of the log alone. Remove the folder, and nothing is lost but speed:
    what is missing, damaged or of another state is read from the log. Needs semmap-log[arrow].

    \b
    Examples:
      semmap-log index office
      semmap-log index office --anew --json
    """
    from semmap_log.log import index

    with progress("Indexing") as told:
        done = index(log, anew=anew, progress=told)
    if as_json:
        print_json(_to_json(done))
        return
    typer.echo(f"closed segments   {done.segments:,}")
    typer.echo(f"tables made       {len(done.made):,} ({counted(done.events, 'event')})")
    if done.skipped:
        typer.echo(f"left to the log   {len(done.skipped):,}, with events of a later version")
    if done.removed:
        typer.echo(f"files removed     {len(done.removed):,}, of no segment any more")
    if done.log_size:
        typer.echo(
            f"bytes             {done.size:,} ({done.size / done.log_size:.0%} of the log's)"
        )


def _to_json(done: Any) -> dict[str, Any]:
    return {
        "segments": done.segments,
        "made": done.made,
        "skipped": done.skipped,
        "removed": done.removed,
        "events": done.events,
        "bytes": done.size,
        "log_bytes": done.log_size,
    }
