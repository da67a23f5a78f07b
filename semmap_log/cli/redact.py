"""`redact`: what nobody shall read any more is taken out of a log, for ever."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import AsJson, WritableLog
from semmap_log.cli.retain import DryRun, Officer, Reason, TrimKey, trim

if TYPE_CHECKING:
    from semmap_log.log import Annotation, DoorLog, Notes, Tracks


def run(
    log: WritableLog,
    *,
    notes: Annotated[
        bool, typer.Option("--notes", help="Every note: who did it, with what, and why.")
    ] = False,
    actor: Annotated[
        list[str] | None,
        typer.Option("--actor", metavar="NAME", help="The notes of that actor; may be repeated."),
    ] = None,
    tracks: Annotated[
        bool, typer.Option("--tracks", help="Where the robot was: all of its poses.")
    ] = False,
    door: Annotated[
        str | None, typer.Option("--door", metavar="DOOR", help="With --key: of this door.")
    ] = None,
    key: Annotated[
        list[str] | None,
        typer.Option("--key", metavar="KEY", help="What was said of it so; may be repeated."),
    ] = None,
    until: Annotated[
        str | None,
        typer.Option("--until", metavar="TIME", help="Only what had been recorded by then."),
    ] = None,
    by: Officer = "",
    reason: Reason = "",
    sign_key: TrimKey = None,
    dry_run: DryRun = False,
    as_json: AsJson = False,
) -> None:
    """Take out of a log who was where, and what nobody shall read, for ever.

    What goes cannot be brought back. All other events keep their bytes, numbers and times, and the
    hash chain can still be verified: a digest stands for what is gone. The log says that, when, by
    whom and why something was taken out. Nobody may be writing; stopped half way, do it again.

    Known copies go, too, or are named: caches, indexes and checkpoints are removed, and with
    --tracks the scans of visits that are kept next to the log; what a crash or `recover` left, and
    copies next to the log, are named. Exports, backups and what was shipped to a store are not
    known.

    Of a signed log give --sign-key, an officer's key: without its statement `verify --public-key`
    ends with 4 from then on. The recorder's key does not do.

    \b
    Examples:
      semmap-log redact office --actor anna --by officer --reason "on request"
      semmap-log redact office --tracks --until "90d ago"
      semmap-log redact office --door 3 --key name --dry-run
    """
    from semmap_log.core.model.commits import Note
    from semmap_log.log import Redaction, read

    if (door is None) == bool(key):
        raise typer.BadParameter("expected both, got one", param_hint="--door and --key")
    with read(log) as opened:
        parts = [*_notes(actor, all_of_them=notes), *_others(opened, door, key, tracks=tracks)]
        limit = opened.limit_of(opened.scope(known_at=until))
        before = (opened.last_event() if limit is None else limit) + 1
        rule = Redaction.of(log, parts, before)
    if not parts:
        expected = "expected --notes, --actor, --tracks, or --door and --key"
        raise typer.BadParameter(expected, param_hint="what to take out")
    note = Note(actor=by, reason=reason)
    trim(log, rule, note, sign_key, dry_run=dry_run, as_json=as_json)


def _notes(actors: list[str] | None, *, all_of_them: bool) -> list[Notes]:
    from semmap_log.log import Notes

    return [Notes()] if all_of_them else [Notes(actor) for actor in actors or ()]


def _others(
    opened: DoorLog, door: str | None, keys: list[str] | None, *, tracks: bool
) -> list[Annotation | Tracks]:
    from semmap_log.log import Annotation, Tracks

    parts: list[Annotation | Tracks] = [Tracks()] if tracks else []
    if door is not None:
        door_id = opened.resolve_any_door(door)
        parts += [Annotation(door_id, key) for key in keys or ()]
    return parts
