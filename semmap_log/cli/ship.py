"""`ship`: a log to a store."""

from __future__ import annotations

from typing import Annotated

import typer

from semmap_log.cli.common import AsJson, WritableLog, a_url, print_json, progress
from semmap_log.common.texts import counted

StoreUrl = Annotated[
    str,
    typer.Argument(metavar="URL", help="Where it is to lie: s3://, gs:// or az://…/NAME."),
]


def run(log: WritableLog, url: StoreUrl, *, as_json: AsJson = False) -> None:
    """Send a log's closed segments to a store; what is there already is not sent again.

    Each segment goes there once, under a name that tells what is in it, then a manifest that
    names them all. Stopped at any moment, and begun again, nothing is lost or sent twice. What
    has gone another way (a log that was put back, or continued on two machines) is refused. The
    log may be written meanwhile: the segment that is being written waits until it is closed.

    Who may write comes from the store's own environment or files, for S3 AWS_ACCESS_KEY_ID,
    AWS_SECRET_ACCESS_KEY, AWS_REGION, AWS_ENDPOINT_URL.

    \b
    Examples:
      semmap-log ship office s3://hospital/logs/office
      semmap-log replay s3://hospital/logs/office --at 10:30
      semmap-log verify s3://hospital/logs/office
    """
    from semmap_log.fleet.shipping import ship

    with progress("Shipping") as told:
        done = ship(log, a_url(url), told)
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
    if done.waits_events:
        events = counted(done.waits_events, "event")
        typer.echo(f"{events} in the segment that is being written: sent once it is closed.")
