"""Small files that can be made again: whole or not there, with a digest, and never synced."""

from __future__ import annotations

import hashlib
import os
import secrets
from contextlib import suppress
from pathlib import Path

TEMPORARY = "."
"""What the name of a file begins with that is not finished, or whose writer was killed."""
_DIGEST_BYTES = 32


def read_checked(path: Path, most: int) -> bytes | None:
    """Return what was written; None: there is nothing that is whole. What is not is removed.

    Args:
        path: The file. Its name and its folder's are under the digest: it is no other's.
        most: A longer one is not read, bytes.
    """
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size - _DIGEST_BYTES
            found = file.read(_DIGEST_BYTES + size) if 0 <= size <= most else b""
    except OSError:
        return None
    data = found[_DIGEST_BYTES:]
    if found[:_DIGEST_BYTES] != _digest(path, data):
        with suppress(OSError):
            path.unlink()
        return None
    return data


def write_checked(path: Path, data: bytes) -> None:
    """Put a file of these bytes in the place of any other, at once.

    Raises:
        OSError: The disk does not let us.
    """
    temporary = path.with_name(f"{TEMPORARY}{path.name}.{os.getpid()}-{secrets.token_hex(4)}")
    try:
        temporary.write_bytes(_digest(path, data) + data)
        temporary.replace(path)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise


def _digest(path: Path, data: bytes) -> bytes:
    return hashlib.sha256(path.parent.name.encode() + path.name.encode() + data).digest()
