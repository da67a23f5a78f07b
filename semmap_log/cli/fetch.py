"""`fetch`: a log back from a store."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from semmap_log.cli.common import AsJson, a_url, print_json, progress
from semmap_log.core.texts import counted


def run(
    url: Annotated[str, typer.Argument(metavar="URL", help="Where a log was shipped to.")],
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder to make.")],
    *,
    as_json: AsJson = False,
) -> None:
    """Bring a shipped log back to a disk: whole, compared with its manifest, and verified.

    The folder has its name only once all is there and right.

    \b
    Examples:
      semmap-log fetch s3://hospital/logs/office office
    """
    from semmap_log.fleet.fetching import fetch

    with progress("Fetching") as told:
        done = fetch(a_url(url), folder, told)
    if as_json:
        print_json(
            {
                "path": str(folder),
                "log_id": done.manifest.info.log_id,
                "segments": len(done.manifest.segments),
                "bytes": done.bytes,
                "events": done.verified.events,
                "head": done.verified.head.hex(),
            }
        )
        return
    segments = counted(len(done.manifest.segments), "segment")
    events = counted(done.verified.events, "event")
    typer.echo(f"{folder}: {events} in {segments}, {done.bytes:,} bytes, verified.")
