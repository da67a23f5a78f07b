"""Options of verbs that keep a log open for writing: how durable, signed by whom, shipped where."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import a_url, say, stopped_for_good
from semmap_log.cli.verb import tell
from semmap_log.core.texts import command_line

if TYPE_CHECKING:
    from semmap_log.fleet.background_shipper import BackgroundShipper
    from semmap_log.log import BackgroundSigner, SigningKey


@contextmanager
def report_at_end(
    background: AbstractContextManager[object], say: Callable[[], None]
) -> Iterator[None]:
    """Run something in the background; report its status at the end, whatever the exit code."""
    left: typer.Exit | None = None
    with background:
        try:
            yield
        except typer.Exit as asked:  # no failure: the log is closed, and says its exit code
            left = asked
    say()
    if left is not None:
        raise left


EVERY = "1m"
"""How often a recorder signs."""

LEAST_S = 0.1
"""How often it can at most."""

PASSPHRASE = "SEMMAP_LOG_KEY_PASSPHRASE"  # noqa: S105 - the name of a variable

SignKey = Annotated[
    Path | None,
    typer.Option(
        "--sign-key",
        metavar="KEY",
        help="Sign the log's end with it, from time to time and when it is closed.",
    ),
]


SignEvery = Annotated[
    str, typer.Option("--sign-every", metavar="TIME", help="--sign-key: how often.")
]


Adopt = Annotated[
    bool,
    typer.Option(
        "--adopt", help="--sign-key: sign also events found there that were not written with it."
    ),
]


def key_to_sign(log: Path, path: Path) -> SigningKey:
    """Return the key to sign a log with; a terminal prompts for its passphrase.

    Raises:
        SigningError: It cannot be used, or lies in the log's folder.
        MissingExtraError: A package is not installed.
    """
    from semmap_log.log import read_key

    return read_key(path, log=log, passphrase=lambda: _passphrase(path))


def _passphrase(path: Path) -> str | None:
    """Return the passphrase of a key, from the environment or a terminal; None: there is none."""
    from getpass import getpass

    said = os.environ.get(PASSPHRASE)
    if said is not None or not sys.stderr.isatty():
        return said
    return getpass(f"Passphrase of {path}: ")  # from the terminal: stdin may be events


def signer_of(log: Path, path: Path | None, every: str, *, adopt: bool) -> BackgroundSigner | None:
    """Return what signs a log while it is written; None: nothing is signed.

    Args:
        log: Its folder.
        path: Of the private key; None: nothing is signed.
        every: How often.
        adopt: Whether it signs also what it finds there.

    Raises:
        SigningError: It cannot be used, or lies in the log's folder.
        MissingExtraError: A package is not installed.
        typer.BadParameter: `every` is no length of time, or there is no key.
    """
    from semmap_log.core.model.moments import SECOND_NS, parse_duration
    from semmap_log.errors import MomentError

    if path is None:
        if adopt:
            raise typer.BadParameter("only with --sign-key", param_hint="--adopt")
        return None
    try:
        every_s = parse_duration(every) / SECOND_NS
    except MomentError as error:
        raise typer.BadParameter(str(error), param_hint="--sign-every") from None
    with stopped_for_good():
        key = key_to_sign(log, path)
    from semmap_log.log import BackgroundSigner

    return BackgroundSigner(log, key, adopt=adopt, tell=tell, every_s=max(every_s, LEAST_S))


def with_signing(log: Path, signer: BackgroundSigner | None) -> AbstractContextManager[None]:
    """Run what signs a log while it is written, and say at the end how far it has come."""
    if signer is None:
        return nullcontext()
    return report_at_end(signer, lambda: _say_how_far(log, signer))


def _say_how_far(log: Path, signer: BackgroundSigner) -> None:
    if not signer.is_all_signed:
        tell(f"not all is signed. To sign it: {command_line('sign', log, '--key', 'KEY')}")
    elif signer.signed_before:
        say(f"{log}: signed up to event {signer.signed_before - 1}.")


def _checked(text: str | None) -> str | None:
    """Return the URL that was given.

    Raises:
        typer.BadParameter: It is none.
    """
    return None if text is None else str(a_url(text))


ShipTo = Annotated[
    str | None,
    typer.Option(
        "--ship",
        metavar="URL",
        help="Send each segment there once it is closed, as `ship` does.",
        callback=_checked,
    ),
]


def with_shipping(log: Path, url: str | None) -> AbstractContextManager[None]:
    """Return what ships a log while it is written, and once more when its writer has ended.

    Args:
        log: Its folder.
        url: Where to; None: nothing is shipped.

    Raises:
        MissingExtraError: A package for stores is not installed.
        LogAccessError: The environment names no store that can be reached.
    """
    if url is None:
        return nullcontext()
    from semmap_log.fleet.background_shipper import BackgroundShipper

    shipper = BackgroundShipper(log, a_url(url), tell=tell)
    return report_at_end(shipper, lambda: _say_how_far_shipped(log, shipper))


def _say_how_far_shipped(log: Path, shipper: BackgroundShipper) -> None:
    status = shipper.status
    if status.is_all_sent and status.shipped is not None:
        done = status.shipped
        say(f"{done.url}: shipped up to event {done.manifest.mark.next_event - 1}.")
    else:
        why = "" if status.problem else ": the end does not wait for it any longer"  # as reported
        tell(f"not all is shipped{why}. To send it: {command_line('ship', log, shipper.url)}")


class SyncChoice(str, Enum):
    """`semmap_log.core.model.commits.Durability`, as typer wants its choices."""

    event = "event"
    batch = "batch"
    flush = "flush"
    none = "none"
