"""What the verbs share that take records out of a log: `redact`, `retain`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import print_json, progress
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.core.model.commits import Note
    from semmap_log.interop.copies.copies_of_log import Copy
    from semmap_log.log.signing.ed25519_sdk import SigningKey
    from semmap_log.log.trimming.trim_log import TrimmedLog, TrimRule

DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Only say what would be taken out; nothing is written.")
]

By = Annotated[
    str, typer.Option("--by", metavar="NAME", help="Who takes it out: for the log's history.")
]
Reason = Annotated[str, typer.Option("--reason", metavar="WHY", help="Why: for the log's history.")]


def trim(
    log: Path, rule: TrimRule, note: Note, sign_key: Path | None, *, dry_run: bool, as_json: bool
) -> None:
    """Take out what a rule says, or count it, of the log and its copies; tell what became of it.

    Args:
        log: Its folder.
        rule: What goes.
        note: Who does it, and why.
        sign_key: Private key of who vouches for it; None: nobody does.
        dry_run: Whether it is only counted.
        as_json: Whether it is told as JSON.
    """
    from semmap_log.interop.copies.copies_of_log import plan_copies, take_out_of_copies
    from semmap_log.interop.copies.going import Going
    from semmap_log.log.trimming.trim_log import plan_trimming, trim_log
    from semmap_log.store.reading.reader import LogReader

    key = None if sign_key is None or dry_run else _checked_key(log, sign_key)
    going = Going.of(rule, LogReader(log))
    with progress("Reading" if dry_run else "Taking out") as told:
        if dry_run:
            found = plan_trimming(log, rule, told)
        else:
            found = trim_log(log, rule, note=note, progress=told)
    if key is not None and found.event is not None:
        _sign(log, key)
    look = plan_copies if dry_run else take_out_of_copies
    copies = look(log, going, is_trimmed=bool(found.done.segments))
    if as_json:
        print_json(_to_json(rule, found, copies, dry_run=dry_run))
        return
    _tell(log, rule, found)
    for copy in copies:
        typer.echo(_told_of(copy, dry_run=dry_run), err=True)
    if found.done.segments:
        typer.echo(f"{log}: {_UNKNOWN}", err=True)


def _checked_key(log: Path, path: Path) -> SigningKey:
    """Return the key that vouches for what goes, once the log is known to be what it has signed."""
    from semmap_log.cli.signing_keys import key_to_sign
    from semmap_log.log.signing.log_signing import check_before_trimming

    key = key_to_sign(log, path)
    with progress("Verifying") as told:
        check_before_trimming(log, key, told)
    return key


def _sign(log: Path, key: SigningKey) -> None:
    from semmap_log.log.signing.log_signing import sign

    with progress("Verifying") as told:
        sign(log, key, trimmed=True, progress=told)


_UNKNOWN = (
    "not known here are exports, backups, joined logs, and copies in other folders, in stores or "
    "on other machines."
)


def _told_of(copy: Copy, *, dry_run: bool) -> str:
    """Return what became of a copy, or would."""
    from semmap_log.interop.copies.copies_of_log import Action

    if copy.action is Action.LEFT:
        return f"{copy.path}: {copy.text}"
    what = {Action.REMOVED: "removed", Action.REWRITTEN: "written again without it"}[copy.action]
    return f"{copy.path}: {'would be ' if dry_run else ''}{what}: {copy.text}."


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


def _to_json(
    rule: TrimRule, found: TrimmedLog, copies: Sequence[Copy], *, dry_run: bool
) -> dict[str, Any]:
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
        "copies": [
            {
                "path": str(copy.path),
                "kind": copy.kind,
                "action": copy.action.value,
                "text": copy.text,
            }
            for copy in copies
        ],
    }
