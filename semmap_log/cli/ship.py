"""`ship`: a log to a store."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from semmap_log.cli.common import AsJson, WritableLog, a_url, check_not_nan, print_json, progress
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.fleet.keeping import RemovedHere, ShippingCheck
    from semmap_log.fleet.removing import Removed
    from semmap_log.fleet.shipping import Shipped

DAY_NS = 86_400 * 10**9
MOST_DAYS = 36_500.0

StoreUrl = Annotated[
    str,
    typer.Argument(metavar="URL", help="Where it is to lie: s3://, gs:// or az://…/NAME."),
]
CheckOnly = Annotated[
    bool,
    typer.Option("--check", help="Send nothing; tell what would be sent, and what is gone there."),
]
RemoveAfter = Annotated[
    float | None,
    typer.Option(
        "--remove-superseded-after",
        metavar="DAYS",
        min=0.0,
        help="Then remove there what was replaced by another segment so long ago, such as 7.",
    ),
]


KeepDays = Annotated[
    float | None,
    typer.Option(
        "--keep-days",
        metavar="DAYS",
        min=0.0,
        help="Then remove here what was shipped, read back, and is so old, such as 30.",
    ),
]


def run(
    log: WritableLog,
    url: StoreUrl,
    *,
    check: CheckOnly = False,
    keep_days: KeepDays = None,
    remove_superseded_after: RemoveAfter = None,
    as_json: AsJson = False,
) -> None:
    """Send a log's closed segments to a store; what is there already is not sent again.

    Each segment goes there once, under a name that identifies its content, then a manifest that
    names them all. Stopped at any moment, and begun again, nothing is lost or sent twice. What
    has gone another way (a log that was put back, or continued on two machines) is refused. The
    log may be written meanwhile: the segment that is being written waits until it is closed.

    Who may write comes from the store's own environment or files, for S3 AWS_ACCESS_KEY_ID,
    AWS_SECRET_ACCESS_KEY, AWS_REGION, AWS_ENDPOINT_URL.

    With --check, 0 says that every closed segment lies there, 1 that some are to be sent, or that
    a shipping is refused, 4 that something which was shipped is gone or damaged. Only where some
    are to be sent, the store is probed by a byte, as a shipping does.

    With --keep-days DAYS closed segments go from this disk, the first ones first, if all in them
    is older, once every byte was read back from the store. The last closed one stays, and the
    log goes on; what a question then needs of the others is read with --with URL, or is an error
    that names the URL. Nobody may be writing.

    A segment that was continued or compacted is replaced; its old object stays, for who is reading
    it, until --remove-superseded-after DAYS removes it. This alone needs the right to remove.

    \b
    Examples:
      semmap-log ship office s3://hospital/logs/office
      semmap-log ship office s3://hospital/logs/office --remove-superseded-after 7
      semmap-log ship office s3://hospital/logs/office --check
      semmap-log verify s3://hospital/logs/office
    """
    from semmap_log.fleet.shipping import ship

    check_not_nan(keep_days=keep_days, remove_superseded_after=remove_superseded_after)
    if check:
        _check(log, url, as_json=as_json)
    with progress("Shipping") as told:
        done = ship(log, a_url(url), told)
    kept_here = None if keep_days is None else _remove_here(log, done, keep_days)
    removed = None
    if remove_superseded_after is not None:
        removed = _remove_superseded(done, remove_superseded_after)
    if as_json:
        print_json(
            {
                "url": str(done.url),
                "log_id": done.manifest.info.log_id,
                "version": done.manifest.version,
                "segments": len(done.manifest.segments),
                "sent": done.sent,
                "sent_bytes": done.sent_bytes,
                "found": done.found,
                "next_event": done.manifest.mark.next_event,
                "head": done.manifest.mark.head,
                "waiting_events": done.waits_events,
                "removed_here": None if kept_here is None else kept_here.segments,
                "removed_here_bytes": None if kept_here is None else kept_here.bytes,
                "removed": None if removed is None else removed.objects,
                "removed_bytes": None if removed is None else removed.bytes,
            }
        )
        return
    if done.sent:
        sent = f"sent {counted(done.sent, 'segment')}, {done.sent_bytes:,} bytes"
    else:
        sent = "nothing to send" if not done.is_new else "all segments were there"
    typer.echo(
        f"{done.url}: {sent}; {done.found} there before. It reaches event "
        f"{done.manifest.mark.next_event - 1}, head {done.manifest.mark.head}"
    )
    _print_waiting(done.waits_events)
    if kept_here is not None and kept_here.segments:
        segments = counted(kept_here.segments, "segment")
        typer.echo(
            f"{segments} removed here, {kept_here.bytes:,} bytes: ask with --with {done.url}"
        )
    if removed is not None and removed.objects:
        objects = counted(removed.objects, "superseded object")
        typer.echo(f"{objects} removed there, {removed.bytes:,} bytes.")


def _remove_here(log: Path, done: Shipped, days: float) -> RemovedHere:
    from semmap_log.core.io.object_store import ObjectStore
    from semmap_log.fleet.keeping import remove_shipped

    before_ns = time.time_ns() - int(min(days, MOST_DAYS) * DAY_NS)
    with progress("Reading back") as told:
        return remove_shipped(log, ObjectStore(done.url), before_ns, told)


def _remove_superseded(done: Shipped, days: float) -> Removed:
    from semmap_log.core.io.object_store import ObjectStore
    from semmap_log.fleet.removing import remove_superseded

    older_ns = int(min(days, MOST_DAYS) * DAY_NS)
    return remove_superseded(ObjectStore(done.url), done.manifest.info.log_id, older_ns)


def _check(log: Path, url: str, *, as_json: bool) -> NoReturn:
    from semmap_log.fleet.keeping import check_shipping

    found = check_shipping(log, a_url(url))
    if as_json:
        print_json(_check_to_json(found))
    else:
        _print_check(found)
    raise typer.Exit(found.exit_code)


def _check_to_json(found: ShippingCheck) -> dict[str, Any]:
    there, superseded = found.manifest, found.superseded
    return {
        "url": str(found.url),
        "version": None if there is None else there.version,
        "segments": 0 if there is None else len(there.segments),
        "next_event": None if there is None else there.mark.next_event,
        "head": None if there is None else there.mark.head,
        "to_send": found.to_send.number,
        "to_send_bytes": found.to_send.bytes,
        "is_manifest_old": found.is_list_old,
        "waiting_events": found.waits_events,
        "honours_conditions": True if found.is_probed else None,
        "superseded": None if superseded is None else superseded.number,
        "superseded_bytes": None if superseded is None else superseded.bytes,
        "problems": list(found.problems),
        "exit_code": found.exit_code,
    }


def _print_check(found: ShippingCheck) -> None:
    there, to_send, superseded = found.manifest, found.to_send, found.superseded
    if to_send.number:
        what = f"{counted(to_send.number, 'segment')} to send, {to_send.bytes:,} bytes"
    else:
        what = "only its manifest to write" if found.is_list_old else "nothing to send"
    if there is None:
        lies = "No log lies there yet."
    else:
        lies = (
            f"This log lies there in {counted(len(there.segments), 'segment')}, up to event "
            f"{there.mark.next_event - 1}, head {there.mark.head}"
        )
    typer.echo(f"{found.url}: {what}. {lies}")
    for problem in found.problems:
        typer.echo(f"damage: {problem}")
    if found.is_probed:
        typer.echo("The store honours conditional writes: a byte was put there to see it.")
    if superseded is None:
        typer.echo("It cannot be listed, so whether all objects are there was not looked at.")
    elif superseded.number:
        objects = counted(superseded.number, "object")
        typer.echo(f"{objects} there that the manifest does not name, {superseded.bytes:,} bytes.")
    _print_waiting(found.waits_events)


def _print_waiting(count: int) -> None:
    if count:
        events = counted(count, "event")
        typer.echo(f"{events} in the segment that is being written: sent once it is closed.")
