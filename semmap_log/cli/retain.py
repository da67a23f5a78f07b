"""`retain`: a log that keeps so much of its past, and no more."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import AsJson, WritableLog
from semmap_log.cli.signing_keys import TrimKey
from semmap_log.cli.trimming import By, DryRun, Reason, trim

if TYPE_CHECKING:
    from semmap_log.log.door_log.door_log import DoorLog


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
    by: By = "",
    reason: Reason = "",
    sign_key: TrimKey = None,
    dry_run: DryRun = False,
    as_json: AsJson = False,
) -> None:
    """Take out of a log what is older than it shall keep, for ever.

    With --keep all sightings, states, requests and poses go that were recorded longer ago, up to
    the last keyframe before that. Which doors, levels, floor plans and rounds there were stays.
    What is then the oldest moment is the log's horizon: a question about what was before is an
    error that names it. The state at the horizon is kept, and the hash chain can still be verified.
    Nobody may be writing; stopped half way, do it again. An age is counted from now, by the clock
    of this machine.

    The scans of visits of that time that are kept beside the log go as well. Caches are removed,
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
    import semmap_log as sl
    from semmap_log.core.model.commits import Note
    from semmap_log.log.trimming.repeated_sightings import Thinning
    from semmap_log.log.trimming.retention import Retention
    from semmap_log.store.reading.reader import LogReader

    if (keep is None) == (thin is None):
        raise typer.BadParameter("expected --keep or --thin", param_hint="what to keep")
    with sl.read(log) as opened:
        until_ns = _until_ns(opened, keep or thin or "")
    rule = (Thinning if keep is None else Retention)(LogReader(log), until_ns)
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
