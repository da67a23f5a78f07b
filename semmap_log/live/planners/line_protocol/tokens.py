"""The secret by which a server knows its clients, where others than its user can reach it."""

from __future__ import annotations

import hmac
import os
import stat
from pathlib import Path

from semmap_log.errors import AddressError

LEAST_TOKEN = 16
"""Characters: fewer can be guessed."""
MOST_TOKEN = 4096

TOKEN = "TOKEN"  # noqa: S105  the word, not one


def read_token(path: Path) -> str:
    """Return the token that a file holds: its one line.

    Raises:
        AddressError: The file cannot be read, others than its owner may read it, or it holds none.
    """
    try:
        with path.open("rb") as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            token = file.read(MOST_TOKEN + 1).decode().strip()
    except (OSError, UnicodeDecodeError) as error:
        raise AddressError(f"{path}: the token cannot be read: {error}") from error
    if mode & 0o077:
        raise AddressError(
            f"{path}: others may read the token (mode {mode:o}); expected 600: chmod 600 {path}"
        )
    if not (LEAST_TOKEN <= len(token) <= MOST_TOKEN and token.isascii() and token.isprintable()):
        raise AddressError(
            f"{path}: expected a token of at least {LEAST_TOKEN} letters and digits on one line; "
            "to make one: head -c 24 /dev/urandom | base64"
        )
    if " " in token:
        raise AddressError(f"{path}: expected a token without blanks.")
    return token


def is_token(line: bytes, token: str) -> bool:
    """Tell whether a line gives the token; it takes as long whatever it gives instead."""
    return hmac.compare_digest(line.strip(), f"{TOKEN} {token}".encode())
