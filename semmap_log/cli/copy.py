"""`copy`: a backup of a log, taken while it is written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import AsJson, print_json, progress
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.log import Copied


def run(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="The log's folder.")],
    target: Annotated[
        Path, typer.Argument(metavar="DEST", help="A new folder, or an earlier copy of the log.")
    ],
    *,
    full: Annotated[
        bool,
        typer.Option(
            "--full", help="Verify what DEST holds already, too; copy again what is damaged there."
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Copy a log, whole and verified, while it is written; the second time only what is new.

    What is copied is read back and verified before it takes its name: every checksum, hash and
    keyframe. Segments that DEST holds already are not read again, only their ends. A damaged log is
    an error, and so is another log in DEST, or one that went on by itself; DEST is as it was then.
    Ctrl-C, a crash or a full disk at any moment leaves a log in DEST; the next copy goes on.

    Left out are torn tails, caches (`index`), and files that are not the log's. The parts of a log
    that lie in a store only, since `ship` removed them, stay there; the copy says where, too.

    \b
    Examples:
      semmap-log copy office /mnt/backup/office
      semmap-log copy office /mnt/backup/office --full
      semmap-log copy office /mnt/backup/office --json
    """
    from semmap_log.log import copy

    with progress("Copying") as told:
        done = copy(log, target, full=full, progress=told)
    if as_json:
        print_json(_to_json(done))
    else:
        _tell(done)


def _tell(done: Copied) -> None:
    events, copied = counted(done.events, "event"), counted(done.segments, "segment")
    typer.echo(
        f"{done.path}: {events}; copied {copied}, {done.bytes:,} bytes, verified; "
        f"kept {done.kept:,} that were there"
    )
    if done.elsewhere:
        typer.echo(f"{counted(done.elsewhere, 'segment')} more lie in a store only, as for the log")
    left = [f"a torn tail of {counted(done.torn_bytes, 'byte')}"] if done.torn_bytes else []
    if left or done.left_out:
        typer.echo(f"left out: {', '.join((*left, *done.left_out))}")
    typer.echo(f"head {done.head.hex()}")


def _to_json(done: Copied) -> dict[str, Any]:
    return {
        "path": str(done.path),
        "log_id": done.log_id,
        "events": done.events,
        "head": done.head.hex(),
        "segments_copied": done.segments,
        "bytes_copied": done.bytes,
        "segments_kept": done.kept,
        "segments_elsewhere": done.elsewhere,
        "torn_bytes": done.torn_bytes,
        "left_out": list(done.left_out),
    }
