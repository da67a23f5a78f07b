"""`sign`: who vouches for a log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import AsJson, WritableLog, print_json, progress, say
from semmap_log.cli.signing_keys import key_to_sign
from semmap_log.common.texts import counted

if TYPE_CHECKING:
    from semmap_log.signing.ed25519_sdk import SigningKey
    from semmap_log.signing.log_signing import Signed


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
    as_json: AsJson = False,
) -> None:
    """Sign the head of what is closed of a log: a change of its past shows from then on.

    Read and checked first is what KEY has not signed yet. In LOG/signatures then lies, for each
    stretch, a statement of a few lines (which log, up to which event, which hash) and its
    signature. Each stands for all events before it. A live segment is signed once it is closed.
    `verify LOG --public-key KEY.pub` checks them, and so does ssh-keygen, without this program.

    KEY is as `ssh-keygen -t ed25519` makes it. It must not lie in the log's folder, and nobody
    else may read it. A passphrase is asked for on a terminal, or taken from the environment
    variable SEMMAP_LOG_KEY_PASSPHRASE. --new-key makes one without a passphrase. Needs
    semmap-log[sign].

    Keep copies of LOG/signatures elsewhere: who can remove the newest events can remove their
    signatures, too.

    \b
    Examples:
      semmap-log sign office --key ~/.ssh/office --new-key
      semmap-log sign office --key ~/.ssh/office
      ssh-keygen -Y verify -f FILE -I NAME -n semmap-log -s X.head.sig < X.head
    """
    from semmap_log.signing.log_signing import sign

    opened = _new_key(log, key) if new_key else key_to_sign(log, key)
    with progress("Verifying") as told:
        done = sign(log, opened, progress=told)
    if as_json:
        print_json(_to_json(done, opened))
    else:
        _tell(log, done, opened)


def _new_key(log: Path, path: Path) -> SigningKey:
    """Make a key pair, for a log that is there."""
    import semmap_log as sl
    from semmap_log.signing.private_keys import make_key

    made = make_key(path, log=log, comment=sl.read(log).info.robot)
    say(f"{path}: a new private key; keep it from others. Whom to believe: {path}.pub")
    return made


def _tell(log: Path, done: Signed, key: SigningKey) -> None:
    from semmap_log.signing.public_keys import fingerprint

    made = counted(len(done.made), "new signature") if done.made else "nothing new to sign"
    reach = f"up to event {done.next_event - 1}" if done.next_event else "no event yet"
    typer.echo(f"{log}: {made}; signed {reach} by {fingerprint(key.public_bytes)}")
    if done.is_live:
        typer.echo("The live segment is signed once it is closed.")


def _to_json(done: Signed, key: SigningKey) -> dict[str, Any]:
    from semmap_log.signing.public_keys import fingerprint

    return {
        "key": fingerprint(key.public_bytes),
        "made": [path.name for path in done.made],
        "signed_before": done.next_event,
        "live": done.is_live,
    }
