"""`retain`: a log that keeps so much of its past, and no more.

`redact` shares its options, and how both remove records and report it. For the verbs that write for
long, `--sign-key` and the status of background tasks are here, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import AsJson, WritableLog, print_json, progress
from semmap_log.cli.writing_options import key_to_sign
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.core.model.commits import Note
    from semmap_log.interop.copies.copies_of_log import Copy
    from semmap_log.log import DoorLog, SigningKey, TrimmedLog, TrimRule


TrimKey = Annotated[
    Path | None,
    typer.Option(
        "--sign-key", metavar="KEY", help="Vouch for what is taken out, with an officer's key."
    ),
]


DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Only say what would be taken out; nothing is written.")
]

Officer = Annotated[
    str, typer.Option("--by", metavar="NAME", help="Who takes it out: for the log's history.")
]
Reason = Annotated[str, typer.Option("--reason", metavar="WHY", help="Why: for the log's history.")]


def trim(
    log: Path, rule: TrimRule, note: Note, sign_key: Path | None, *, dry_run: bool, as_json: bool
) -> None:
    """Remove what a rule names from the log and its copies, or count it; report what was done.

    Args:
        log: Its folder.
        rule: What goes.
        note: Who does it, and why.
        sign_key: Private key of who vouches for it; None: nobody does.
        dry_run: Whether it is only counted.
        as_json: Whether the report is JSON.
    """
    from semmap_log.interop.copies.copies_of_log import plan_copies, take_out_of_copies
    from semmap_log.interop.copies.going import Going
    from semmap_log.log import plan_trimming, read, trim_log

    key = None if sign_key is None or dry_run else _checked_key(log, sign_key)
    going = Going.of(rule, read(log))
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
    from semmap_log.log import check_before_trimming

    key = key_to_sign(log, path)
    with progress("Verifying") as told:
        check_before_trimming(log, key, told)
    return key


def _sign(log: Path, key: SigningKey) -> None:
    from semmap_log.log import sign

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


def run(
    log: WritableLog,
    *,
    keep: Annotated[
        str | None,
        typer.Option(
            "--keep", metavar="AGE", help="Keep the last 2y, 26w, 90d; or from a TIME on."
        ),
    ] = None,
    thin: Annotated[
        str | None,
        typer.Option("--thin", metavar="AGE", help="Of what is older, take out what repeats."),
    ] = None,
    by: Officer = "",
    reason: Reason = "",
    sign_key: TrimKey = None,
    dry_run: DryRun = False,
    as_json: AsJson = False,
) -> None:
    """Take out of a log what is older than it shall keep, for ever.

    With --keep all sightings, states, requests and poses go that were recorded longer ago, up to
    the last keyframe before that. Which doors, levels, floor plans and rounds there were stays.
    What is then the oldest moment is the log's horizon: a question about what was before is an
    error that names it. The state at the horizon is kept, with the event that set it for each door,
    and the hash chain can still be verified.
    Nobody may be writing; stopped half way, do it again. An age is counted from now, by the clock
    of this machine.

    The scans of visits of that time that are kept next to the log go as well. Caches are removed,
    and other known copies are named.

    With --thin robot poses go that are older, and sightings that repeat others: of those of a door
    that follow each other in one hour and say the same, the first and the last stay. Every question
    about states is answered as before; probabilities move a little, for they count sightings.

    Of a signed log give --sign-key, an officer's key: without its statement `verify --public-key`
    ends with 4 from then on. The recorder's key does not do.

    \b
    Examples:
      semmap-log retain office --keep 2y --dry-run
      semmap-log retain office --keep 2y --by admin --reason "data policy"
      semmap-log retain office --thin 90d
      semmap-log retain office --keep 2026-01-01
    """
    from semmap_log.core.model.commits import Note
    from semmap_log.log import Retention, Thinning, read

    if (keep is None) == (thin is None):
        raise typer.BadParameter("expected --keep or --thin", param_hint="what to keep")
    with read(log) as opened:
        until_ns = _until_ns(opened, keep or thin or "")
    rule = (Thinning if keep is None else Retention)(log, until_ns)
    note = Note(actor=by, reason=reason)
    trim(log, rule, note, sign_key, dry_run=dry_run, as_json=as_json)


def _until_ns(log: DoorLog, told: str) -> int:
    """Return the moment that an age or a time means.

    Raises:
        MomentError: It is neither.
        typer.BadParameter: It is still to come.
    """
    from semmap_log.core.io.clock import SystemClock, believable_ns
    from semmap_log.core.model.moments import format_local, parse_duration
    from semmap_log.errors import MomentError

    now_ns = believable_ns(SystemClock())
    try:
        return now_ns - parse_duration(told)
    except MomentError as error:
        try:
            until_ns = log.instant(told)
        except MomentError:
            raise error from None
    assert until_ns is not None, "it was told"
    if until_ns > now_ns:
        when = format_local(until_ns, log.info.timezone)
        raise typer.BadParameter(f"{when} is still to come", param_hint="what to keep")
    return until_ns
