"""What the verbs share that take records out of a log: `redact`, `retain`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import print_json, progress
from semmap_log.common.texts import counted

if TYPE_CHECKING:
    from semmap_log.domain.commits import Note
    from semmap_log.trimming.trim_log import TrimmedLog, TrimRule

DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Only say what would be taken out; nothing is written.")
]

By = Annotated[
    str, typer.Option("--by", metavar="NAME", help="Who takes it out: for the log's history.")
]
Reason = Annotated[str, typer.Option("--reason", metavar="WHY", help="Why: for the log's history.")]


def trim(log: Path, rule: TrimRule, note: Note, *, dry_run: bool, as_json: bool) -> None:
    """Take out what a rule says, or count it, and tell what became of it."""
    from semmap_log.trimming.trim_log import plan_trimming, trim_log

    with progress("Reading" if dry_run else "Taking out") as told:
        if dry_run:
            found = plan_trimming(log, rule, told)
        else:
            found = trim_log(log, rule, note=note, progress=told)
    if as_json:
        print_json(_to_json(rule, found, dry_run=dry_run))
    else:
        _tell(log, rule, found)


def _tell(log: Path, rule: TrimRule, found: TrimmedLog) -> None:
    done = found.done
    what = f"{counted(done.events, 'event')} and {counted(done.notes, 'note')}"
    files = counted(done.segments, "file")
    if not done.segments:
        typer.echo(f"{log}: {rule.words}: there is nothing of that to take out.")
    elif found.event is None:
        typer.echo(f"{log}: {rule.words}: would take out {what} of {files}.")
    else:
        typer.echo(f"{log}: {rule.words}: took out {what} of {files}; event {found.event} says so.")
    if done.bytes_after is not None and done.segments:
        typer.echo(f"bytes  {done.bytes_before:,} -> {done.bytes_after:,}")
    for path in found.copies:
        typer.echo(f"{path}: may hold it still; look at it, and remove it.", err=True)


def _to_json(rule: TrimRule, found: TrimmedLog, *, dry_run: bool) -> dict[str, Any]:
    done = found.done
    return {
        "rule": rule.words,
        "dry_run": dry_run,
        "event": found.event,
        "segments": done.segments,
        "events": done.events,
        "notes": done.notes,
        "bytes_before": done.bytes_before,
        "bytes_after": done.bytes_after,
        "copies": [str(path) for path in found.copies],
    }
