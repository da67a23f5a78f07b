"""`sign`: who vouches for a log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import AsJson, WritableLog, print_json, progress, say
from semmap_log.cli.writing_options import key_to_sign
from semmap_log.core.texts import command_line, counted

if TYPE_CHECKING:
    from semmap_log.log import PublicKey, Signed, SigningKey


def run(
    log: WritableLog,
    *,
    key: Annotated[
        Path,
        typer.Option("--key", metavar="KEY", help="A private key of Ed25519; see above."),
    ],
    new_key: Annotated[
        bool, typer.Option("--new-key", help="Make KEY and KEY.pub first; nothing is replaced.")
    ] = False,
    adopt: Annotated[
        bool,
        typer.Option(
            "--adopt", help="Sign it as it is, whatever KEY has signed before; see above."
        ),
    ] = False,
    next_key: Annotated[
        Path | None,
        typer.Option(
            "--next-key", metavar="PUB", help="Name the key that signs this log from now on."
        ),
    ] = None,
    timestamp: Annotated[
        str,
        typer.Option(
            "--timestamp", metavar="URL", help="Get a time stamp (RFC 3161) for what is signed."
        ),
    ] = "",
    revoke: Annotated[
        Path | None,
        typer.Option(
            "--revoke", metavar="PUB", help="Sign nothing but that this key is not believed …"
        ),
    ] = None,
    first: Annotated[
        int | None,
        typer.Option(
            "--from", metavar="NUMBER", min=0, help="--revoke: … from its statement NUMBER on."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Sign the head of what is closed of a log: a change of its past shows from then on.

    All of it is read and checked first. In LOG/signatures then lies, for each closed segment, a
    statement of a few lines (which log, up to which event, which hash, what was taken out) and its
    signature. Each stands for all before it. A live segment is signed once it is closed. `verify
    LOG --public-key KEY.pub` checks them, and so does ssh-keygen, without this program.

    What was signed last is kept in KEY.state. A log that does not go on from there was rolled back
    or rewritten, and is refused; --adopt signs it all the same, and the statement says which events
    were adopted: `verify` ends with 6 until another key has signed them, too. Of a log out of which
    something was taken without a signature (`retain`, `redact` have --sign-key), --adopt makes a
    statement that vouches for what is gone; it counts if `verify` believes KEY for semmap-log-trim.

    With --next-key, KEY signs no more of this log; who believes KEY believes its successor.

    With --revoke, KEY is an owner's key, which is kept offline. Statements of PUB from NUMBER on
    (the last number in their files' names) do not count from then on; those before it do. `verify`
    believes that if its allowed_signers file has KEY for semmap-log-revoke.

    With --timestamp, the authority at URL gets the hash of KEY's newest statement, and its answer
    is kept with that, as X.head.tsr; a statement that has one gets no other. It proves
    that all that was signed by then was signed not later. Its own signature is not checked by
    `verify`, but by openssl, with the authority's certificate.

    KEY is as `ssh-keygen -t ed25519` makes it. It must not lie in the log's folder, and nobody
    else may read it. A terminal prompts for a passphrase, or it is taken from the environment
    variable SEMMAP_LOG_KEY_PASSPHRASE. --new-key makes one without a passphrase. Needs
    semmap-log[sign].

    Keep copies of LOG/signatures elsewhere: who can remove the newest events can remove their
    signatures, too.

    \b
    Examples:
      semmap-log sign office --key ~/.ssh/office --new-key
      semmap-log sign office --key ~/.ssh/office
      ssh-keygen -Y verify -f FILE -I NAME -n semmap-log -s X.head.sig < X.head
      openssl ts -verify -data X.head -in X.head.tsr -CAfile ca.pem
    """
    from semmap_log.core.io.url_path import is_http
    from semmap_log.log import sign, stamp_newest

    if (revoke is None) != (first is None):
        raise typer.BadParameter("give both: --revoke PUB --from NUMBER", param_hint="--revoke")
    if revoke is not None and first is not None:
        if new_key or adopt or next_key or timestamp:
            raise typer.BadParameter("only with --key and --from", param_hint="--revoke")
        _revoke(log, key_to_sign(log, key), revoke, first, as_json=as_json)
        return
    if timestamp and not is_http(timestamp):
        hint = f"expected http://… or https://…, got {timestamp!r}"
        raise typer.BadParameter(hint, param_hint="--timestamp")
    successor = None if next_key is None else _only_key(next_key, "--next-key")
    opened = _new_key(log, key) if new_key else key_to_sign(log, key)
    with progress("Verifying") as told:
        done = sign(log, opened, adopt=adopt, next_key=successor, progress=told)
    if as_json:
        print_json(_to_json(done, opened))
    else:
        _tell(log, done, opened)
    if timestamp and (stamped := stamp_newest(log, opened, timestamp)):
        say(f"{stamped.file.name}: time stamp of {stamped.time}")


def _revoke(log: Path, owner: SigningKey, path: Path, first: int, *, as_json: bool) -> None:
    """Revoke a key, and say from where on."""
    from semmap_log.log import revoke

    revoked = _only_key(path, "--revoke")
    made = revoke(log, owner, revoked, first=first)
    if as_json:
        print_json({"revoked": revoked.fingerprint, "from": first, "made": made.name})
    else:
        typer.echo(f"{log}: {revoked} is revoked from its statement {first} on: {made.name}")


def _only_key(path: Path, option: str) -> PublicKey:
    """Return the key in a file, which has to be the only one."""
    from semmap_log.log import read_public_keys

    found = list(read_public_keys([path]).values())
    if len(found) != 1:
        raise typer.BadParameter(f"expected one key, got {len(found)}", param_hint=option)
    return found[0]


def _new_key(log: Path, path: Path) -> SigningKey:
    """Make a key pair, for a log that is there."""
    from semmap_log.log import make_key, read

    made = make_key(path, log=log, comment=read(log).info.robot)
    say(f"{path}: a new private key; keep it from others. Whom to believe: {path}.pub")
    return made


def _tell(log: Path, done: Signed, key: SigningKey) -> None:
    made = counted(len(done.made), "new signature") if done.made else "nothing new to sign"
    reach = f"up to event {done.next_event - 1}" if done.next_event else "no event yet"
    typer.echo(f"{log}: {made}; signed {reach} by {_fingerprint(key)}")
    if done.is_live:
        typer.echo("The live segment is signed once it is closed.")
    if done.adopted is not None:
        first, last = done.adopted
        typer.echo(f"Events {first}..{last} were adopted: signed as they were found.")
    if done.unvouched_events:
        line = command_line("sign", log, "--key", "OFFICER_KEY", "--adopt")
        what = counted(done.unvouched_events, "event")
        typer.echo(f"{what} were taken out without an officer's signature; to vouch for it: {line}")


def _to_json(done: Signed, key: SigningKey) -> dict[str, Any]:
    return {
        "key": _fingerprint(key),
        "made": [path.name for path in done.made],
        "signed_before": done.next_event,
        "live": done.is_live,
    }


def _fingerprint(key: SigningKey) -> str:
    from semmap_log.log import PublicKey

    return PublicKey(key.public_bytes).fingerprint
