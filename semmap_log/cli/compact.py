"""`compact`: the same log in fewer bytes and files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import AsJson, WritableLog, print_json, progress
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path, PurePath

    from semmap_log.log import Compacted


def run(
    log: WritableLog,
    *,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only say what would be done; needs no write access.")
    ] = False,
    no_merge: Annotated[
        bool, typer.Option("--no-merge", help="Keep every segment a file of its own.")
    ] = False,
    free_now: Annotated[
        bool,
        typer.Option(
            "--free-now",
            help="Remove files that were merged at once, not after an hour: only if nobody copies "
            "the folder with `cp` or the like.",
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Make a log smaller: compress its closed segments, and merge small ones that are neighbours.

    Every record stays as it is, in its place, and each copy is compared with the old file before
    it takes its name. Ctrl-C, or a crash, at any moment leaves the whole log. Nobody may be
    writing; readers are not disturbed, nor is a copy of the folder: files that were merged stay for
    an hour, and the first writer or compaction after that removes them.

    \b
    Examples:
      semmap-log compact office
      semmap-log compact office --dry-run
      semmap-log compact office --no-merge --json
      semmap-log compact office --free-now
    """
    from semmap_log.log import compact, plan_compaction

    if dry_run:
        done = plan_compaction(log, merge=not no_merge)
    else:
        with progress("Compacting") as told:
            keep_s = 0.0 if free_now else None
            done = compact(log, merge=not no_merge, keep_s=keep_s, progress=told)
    if as_json:
        print_json(_to_json(done, dry_run=dry_run))
    else:
        _tell(log, done, dry_run=dry_run)


def _tell(log: Path, done: Compacted, *, dry_run: bool) -> None:
    if not done.steps:
        typer.echo(f"{log}: nothing to do; closed segments: {done.segments_before}, all compact.")
        return
    for files in done.steps if dry_run else ():
        typer.echo(_intention(files))
    typer.echo(f"closed segments   {done.segments_before:,} -> {done.segments_after:,}")
    if done.bytes_after is None:
        typer.echo(f"bytes             {done.bytes_before:,}")
        return
    less = 1 - done.bytes_after / done.bytes_before
    typer.echo(f"bytes             {done.bytes_before:,} -> {done.bytes_after:,} ({less:.0%} less)")
    if done.events:
        before, after = done.bytes_before / done.events, done.bytes_after / done.events
        events = counted(done.events, "event")
        typer.echo(f"bytes an event    {before:,.1f} -> {after:,.1f} ({events})")
    if done.merged_files:
        _print_merged(done)


def _print_merged(done: Compacted) -> None:
    files = counted(done.merged_files, "merged file")
    typer.echo(
        f"{files}, {done.merged_bytes:,} bytes, stay for an hour, so that copies of the folder "
        "that are under way are whole; the first writer or compaction after that removes them."
    )


def _intention(files: Sequence[PurePath]) -> str:
    if len(files) == 1:
        return f"would compress {files[0].name}"
    return f"would merge {len(files)} segments, {files[0].name} to {files[-1].name}"


def _to_json(done: Compacted, *, dry_run: bool) -> dict[str, Any]:
    def each(size: int | None) -> float | None:
        return None if size is None or not done.events else round(size / done.events, 2)

    return {
        "dry_run": dry_run,
        "segments_before": done.segments_before,
        "segments_after": done.segments_after,
        "bytes_before": done.bytes_before,
        "bytes_after": done.bytes_after,
        "merged_files": done.merged_files,
        "merged_bytes": done.merged_bytes,
        "events": done.events,
        "bytes_per_event_before": each(done.bytes_before),
        "bytes_per_event_after": each(done.bytes_after),
        "steps": [
            {"files": [path.name for path in files], "into": files[0].name} for files in done.steps
        ],
    }
