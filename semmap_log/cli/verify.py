"""`verify`: whether a log is as it was written."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from semmap_log.cli.common import AnyLogPath, AsJson, console, print_json, progress

HEAD_BYTES = 32

Head = Annotated[
    str,
    typer.Option(
        "--head", metavar="HASH", help="A head that `info` or `verify` printed: still in the log?"
    ),
]


def run(
    log: AnyLogPath,
    *,
    head: Head = "",
    as_json: AsJson = False,
) -> None:
    """Read every byte of a log and say what is not as it was written. Never writes.

    Checked are all checksums, lengths and times, the numbers of the events, the hash chain over
    all segments, each keyframe against a replay, and what the summaries say. With --head HASH
    also whether the log still holds that commit: so a tail that was cut off shows.

    Exit code: 0 good, 1 it could not be read, 2 usage, 3 a torn tail and nothing else (as a crash
    leaves it; a commit that a writer is just writing looks the same), 4 damage, 5 not a log.

    \b
    Examples:
      semmap-log verify office
      semmap-log verify office --head "$(cat office.head)"
      semmap-log verify office/office_000000.mcap --json
    """
    from semmap_log.replay.care import verify
    from semmap_log.views.health import verification_report

    wanted = _hash(head) if head else None
    with progress("Verifying") as told:
        found = verify(log, wanted, told)
    if as_json:
        print_json(to_json(found))
    else:
        console().print(verification_report(found))
    raise typer.Exit(found.exit_code)


def to_json(found: Any) -> dict[str, Any]:
    """Return a Verification as `--json` prints it."""
    from semmap_log.views.health import verdict

    return {
        "path": str(found.path),
        "verdict": verdict(found),
        "exit_code": found.exit_code,
        "log_id": found.log_id,
        "segments": found.segments,
        "commits": found.commits,
        "events": found.events,
        "keyframes": found.keyframes,
        "bytes": found.size,
        "head": found.head.hex(),
        "events_after_head": found.events_after_head,
        "findings": [
            {
                "kind": finding.kind,
                "severity": finding.severity.name.lower(),
                "file": finding.path.name,
                "offset": finding.offset,
                "events": finding.events,
                "text": finding.text,
            }
            for finding in found.findings
        ],
    }


def _hash(text: str) -> bytes:
    try:
        head = bytes.fromhex(text.strip())
    except ValueError:
        head = b""
    if len(head) != HEAD_BYTES:
        raise typer.BadParameter(
            f"expected {2 * HEAD_BYTES} hexadecimal digits, got {text!r}", param_hint="--head"
        )
    return head
