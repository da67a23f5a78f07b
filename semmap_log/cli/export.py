"""`export`: the state or the events as a file for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from semmap_log.cli.common import At, KnownAt, LogPath, UpToEvent, progress, say


def run(
    log: LogPath,
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="The file; its name tells the format.")
    ],
    *,
    at: At = None,
    known_at: KnownAt = None,
    event: UpToEvent = None,
    default_prob: Annotated[
        float | None,
        typer.Option(
            "--default-prob",
            metavar="P",
            help="Thesis YAML: the probability of doors that have none.",
        ),
    ] = None,
) -> None:
    """Write a file, whole or not at all; an old file of that name is replaced at once.

    \b
    Formats, by the file's name:
      .yaml    the thesis's door database, as its server loads it
      .csv     timestamp,door,state,accuracy: every state that was set or seen
      .jsonl   every event but retracted ones, one JSON object a line
      .parquet every event, retracted ones marked, with who and why: for pandas,
               DuckDB, polars (needs semmap-log[arrow])
      .rrd     a recording for the rerun viewer
      .html    a page for any browser; `semmap-log report` has more choices
      .pgm     a costmap with its .yaml; `semmap-log costmap` has levels and more

    \b
    Examples:
      semmap-log export office doors.yaml --default-prob 0.5
      semmap-log export office before.yaml --at "yesterday 14:00"
      semmap-log export office events.jsonl
      semmap-log export office march.parquet --at 2026-04-01
    """
    import semmap_log as sl
    from semmap_log.exporting.log_files import export

    opened = sl.read(log)
    scope = opened.scope(at, known_at, event)
    with progress("Exporting") as told:
        done = export(opened, out, scope, default_prob=default_prob, progress=told)
    for text in done.left_out:
        say(f"left out: {text}")
    say(f"{out}: {done.what}.")
