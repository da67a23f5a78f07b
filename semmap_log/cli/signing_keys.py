"""The key with which verbs sign, and `--sign-key` of the verbs that write for long."""

from __future__ import annotations

import os
import sys
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import say, stopped_for_good
from semmap_log.cli.failures import tell
from semmap_log.cli.told_at_end import told_at_end
from semmap_log.common.texts import command_line

if TYPE_CHECKING:
    from semmap_log.signing.ed25519_sdk import SigningKey
    from semmap_log.signing.sign_beside import SignBeside

PASSPHRASE = "SEMMAP_LOG_KEY_PASSPHRASE"  # noqa: S105 - the name of a variable

SignKey = Annotated[
    Path | None,
    typer.Option(
        "--sign-key",
        metavar="KEY",
        help="Sign each segment with it once it is closed, as `sign` does.",
    ),
]


def key_to_sign(log: Path, path: Path) -> SigningKey:
    """Return the key to sign a log with; its passphrase is asked for on a terminal.

    Raises:
        SigningError: It cannot be used, or lies in the log's folder.
        MissingExtraError: A package is not installed.
    """
    from semmap_log.signing.private_keys import read_key

    return read_key(path, log=log, passphrase=lambda: _passphrase(path))


def _passphrase(path: Path) -> str | None:
    """Return the passphrase of a key, from the environment or a terminal; None: there is none."""
    from getpass import getpass

    said = os.environ.get(PASSPHRASE)
    if said is not None or not sys.stderr.isatty():
        return said
    return getpass(f"Passphrase of {path}: ")  # from the terminal: stdin may be events


def signed_beside(log: Path, path: Path | None) -> AbstractContextManager[None]:
    """Return what signs a log while it is written, and once more when its writer has ended.

    Args:
        log: Its folder.
        path: Of the private key; None: nothing is signed.

    Raises:
        SigningError: It cannot be used, or lies in the log's folder.
        MissingExtraError: A package is not installed.
    """
    if path is None:
        return nullcontext()
    with stopped_for_good():
        key = key_to_sign(log, path)
    from semmap_log.signing.sign_beside import SignBeside

    beside = SignBeside(log, key, tell=tell)
    return told_at_end(beside, lambda: _say_how_far(log, beside))


def _say_how_far(log: Path, beside: SignBeside) -> None:
    if not beside.is_all_signed:
        tell(f"not all is signed. To sign it: {command_line('sign', log, '--key', 'KEY')}")
    elif beside.signed is not None and beside.signed.next_event:
        say(f"{log}: signed up to event {beside.signed.next_event - 1}.")
