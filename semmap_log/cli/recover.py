"""`recover`: what can be saved of a damaged log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from semmap_log.cli.common import AsJson, WritableLog, console, print_json, progress

NEEDS_YES = 4
"""Exit code if there is something to do, and no option has confirmed it."""

Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="NEW", help="Make a new log there; the damaged one stays."),
]
Yes = Annotated[bool, typer.Option("--yes", help="Do it; without it, only show what would be.")]


def run(log: WritableLog, *, out: Out = None, yes: Yes = False, as_json: AsJson = False) -> None:
    """Save what is whole of a damaged log, and name what is lost. Without --yes nothing is written.

    A commit is saved if all of it is there as it was written, by its checksums and its own hash;
    else it is lost as a whole. Events keep their fields and times; after a gap they get new
    numbers, and the log a new id. The damaged files are kept, in a folder `damaged-1` inside the
    log's, or where they are with --out. A torn tail is no damage: the next writer mends it.

    Exit code: 0 done or nothing to do, 1 our error, 2 usage, 4 there is something to do.

    \b
    Examples:
      semmap-log recover office
      semmap-log recover office --yes
      semmap-log recover office --out office-saved --yes
    """
    from semmap_log.log import plan_recovery, recover, recover_into
    from semmap_log.views.health import recovery_report

    with progress("Reading") as told:
        if not yes:
            found, done = plan_recovery(log, told), None
        else:
            done = recover_into(log, out, progress=told) if out else recover(log, progress=told)
            found = done.plan
    if as_json:
        print_json(_to_json(found, done))
    else:
        console().print(recovery_report(found, done))
    if found.has_to_do and not yes:
        raise typer.Exit(NEEDS_YES)


def _to_json(found: Any, done: Any) -> dict[str, Any]:
    from semmap_log.core.model.moments import format_utc

    def when(ns: int | None) -> str | None:
        return None if ns is None else format_utc(ns)

    return {
        "path": str(found.path),
        "damaged": found.has_to_do,
        "lost_events": found.lost_events,
        "lost": [
            {
                "first_event": loss.first_event,
                "last_event": loss.last_event,
                "after": when(loss.after_ns),
                "before": when(loss.before_ns),
                "files": list(loss.files),
                "why": list(loss.why),
            }
            for loss in found.losses
        ],
        "doors_without_adding": list(found.doors),
        "dropped_retractions": list(found.dropped),
        "commits": found.commits,
        "events": found.events,
        "recorded": [when(ns) for ns in found.span_ns] if found.span_ns else None,
        "keeps_numbers": found.keeps_numbers,
        "log": str(done.log) if done and done.log else None,
        "damaged_files": str(done.kept) if done and done.kept else None,
    }
