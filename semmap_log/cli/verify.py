"""`verify`: whether a log is as it was written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import AnyLogPath, AsJson, console, print_json, progress

if TYPE_CHECKING:
    from semmap_log.log import SignedVerification

HEAD_BYTES = 32

Head = Annotated[
    str,
    typer.Option(
        "--head", metavar="HASH", help="A head that `info` or `verify` printed: still in the log?"
    ),
]
PublicKeys = Annotated[
    list[Path] | None,
    typer.Option(
        "--public-key", metavar="FILE", help="Check its signatures: a .pub or allowed_signers."
    ),
]
Signatures = Annotated[
    list[Path] | None,
    typer.Option(
        "--signatures", metavar="PATH", help="Also these, kept elsewhere: a folder or a .head."
    ),
]
AllowUnsignedEnd = Annotated[
    bool,
    typer.Option(
        "--allow-unsigned-end", help="With --public-key: events after the last signed are no fault."
    ),
]


def run(
    log: AnyLogPath,
    *,
    head: Head = "",
    public_key: PublicKeys = None,
    signatures: Signatures = None,
    allow_unsigned_end: AllowUnsignedEnd = False,
    as_json: AsJson = False,
) -> None:
    """Read every byte of a log and say what is not as it was written. Never writes.

    Checked are all checksums, lengths and times, the numbers of the events, the hash chain over
    all segments, each keyframe against a replay, and what the summaries say. With --head HASH
    also whether the log still holds that commit: so a tail that was cut off shows. Of a join,
    each of its logs is verified; the exit code is the greatest.

    With --public-key also what `sign` has signed: whether the log was rolled back, rewritten or
    forked since, whether something was taken out of it without an officer's signature, and whether
    all of it is signed, by a key in FILE. --signatures are copies of LOG/signatures: they show when
    events were removed together with their signatures. Both may be given more than once. Needs
    semmap-log[sign].

    Exit code: 0 good, 1 it could not be read, 2 usage, 3 a torn tail and nothing else (as a crash
    leaves it; a commit that a writer is just writing looks the same), 4 damage, or not as signed,
    5 not a log, 6 as signed, and events at its end are not signed, or were signed as found there.

    \b
    Examples:
      semmap-log verify office
      semmap-log verify office --head "$(cat office.head)"
      semmap-log verify office/office_000000.mcap --json
      semmap-log verify office --public-key k.pub
      semmap-log verify office --public-key k.pub --signatures /backup/office
    """
    from semmap_log.core.io.virtual_logs import has_virtual_suffix
    from semmap_log.log import verify
    from semmap_log.views.health import verification_report

    wanted = _hash(head) if head else None
    if public_key or signatures:
        _verify_signed(
            log, public_key or [], signatures or [], wanted,
            allow_unsigned_end=allow_unsigned_end, as_json=as_json,
        )  # fmt: skip
    if has_virtual_suffix(log) and log.is_file():
        _verify_joined(log, wanted, as_json=as_json)
        return
    with progress("Verifying") as told:
        found = verify(log, wanted, told)
    if as_json:
        print_json(to_json(found))
    else:
        console().print(verification_report(found))
    raise typer.Exit(found.exit_code)


def _verify_signed(
    log: Path,
    keys: list[Path],
    elsewhere: list[Path],
    head: bytes | None,
    *,
    allow_unsigned_end: bool,
    as_json: bool,
) -> None:
    """Verify a log and its signatures, and leave with the exit code."""
    from semmap_log.core.io.virtual_logs import has_virtual_suffix
    from semmap_log.views.health import signed_verification_report

    if not keys:
        raise typer.BadParameter("say whom to believe: --public-key", param_hint="--signatures")
    if log.suffix == ".mcap" or has_virtual_suffix(log):
        raise typer.BadParameter("ask of one whole log", param_hint="--public-key")
    from semmap_log.log import read_public_keys, verify_signed

    believed = read_public_keys(keys)
    with progress("Verifying") as told:
        done = verify_signed(
            log, believed, elsewhere=elsewhere, head=head, allow_unsigned_end=allow_unsigned_end,
            progress=told,
        )  # fmt: skip
    if as_json:
        print_json(_signed_to_json(done))
    else:
        console().print(signed_verification_report(done))
    raise typer.Exit(done.found.exit_code)


def _signed_to_json(done: SignedVerification) -> dict[str, Any]:
    """Return the same as without signatures, and what they say."""
    signed = {
        "statements": done.statements,
        "good": done.good,
        "signed_before": done.signed_before,
        "by": [{"key": key.fingerprint, "owner": key.owner} for key in done.by],
        "timestamps": [{"statement": str(path), "time": time} for path, time in done.times],
    }
    return {**to_json(done.found), "signatures": signed}


def _verify_joined(log: Path, head: bytes | None, *, as_json: bool) -> None:
    """Verify each log of a join: the join has no bytes of its own."""
    from semmap_log.fleet.join.joined_logs import flat_definition
    from semmap_log.log import verify
    from semmap_log.views.health import verification_report

    if head is not None:
        raise typer.BadParameter("a join has no head; ask of one of its logs", param_hint="--head")
    with progress("Verifying") as told:
        places = dict.fromkeys(one.place for one in flat_definition(log).logs)
        found = [verify(place, None, told) for place in places]
    if as_json:
        print_json([to_json(one) for one in found])
    else:
        for one in found:
            console().print(verification_report(one))
    raise typer.Exit(max(one.exit_code for one in found))


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
