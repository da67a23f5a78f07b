"""Who signs: a private key of OpenSSH, read or made. It lies outside of every log."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from semmap_log.core.io.disk import refuse_own_folder, sync_folder, write_all
from semmap_log.core.io.file_calls import NO_LINK, PLAIN
from semmap_log.errors import OutputError, PassphraseError, SigningError
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.public_keys import PublicKey

_PRIVATE_MODE, _PUBLIC_MODE = 0o600, 0o644
_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_MOST_BYTES = 2**16

Passphrase = Callable[[], str | None]
"""Called when a key needs a passphrase; None: there is none."""


def read_key(path: Path, *, log: Path, passphrase: Passphrase = lambda: None) -> SigningKey:
    """Return the key to sign a log with.

    Args:
        path: A private key of Ed25519, as `ssh-keygen -t ed25519` makes it.
        log: The log's folder, in which no key may lie.
        passphrase: Where the passphrase comes from, if the key has one.

    Raises:
        SigningError: It lies in the log's folder, cannot be read, others may read it, or it is no
            such key.
        MissingExtraError: A package is not installed.
    """
    _refuse_inside(log, path)
    data = _private_bytes(path)
    try:
        try:
            key = SigningKey.of_openssh(data)
        except PassphraseError:
            key = SigningKey.of_openssh(data, passphrase=passphrase())
    except SigningError as error:
        raise type(error)(f"{path}: {error}.") from None
    key.path = path.absolute()
    return key


def make_key(path: Path, *, log: Path, comment: str = "") -> SigningKey:
    """Make a key pair: the private key at a path, the public one beside it as `.pub`.

    The private key belongs to its owner alone from its first instant on. Nothing is replaced.

    Raises:
        SigningError: It would lie in the log's folder; one of the two files is there already, or
            cannot be written.
    """
    _refuse_inside(log, path)
    public = path.with_name(f"{path.name}.pub")
    for each in (path, public):
        if os.path.lexists(each):
            raise SigningError(f"{each}: is there already; a key is never replaced.")
    key = SigningKey.drawn()
    _write_new(path, key.to_openssh(), _PRIVATE_MODE)
    try:
        line = PublicKey(key.public_bytes, comment).line
        _write_new(public, line.encode(), _PUBLIC_MODE)
        sync_folder(path.absolute().parent)
    except BaseException:
        with suppress(OSError):
            path.unlink()
        raise
    key.path = path.absolute()
    return key


def _refuse_inside(log: Path, path: Path) -> None:
    """Keep keys out of a log's folder, which is copied and shipped."""
    try:
        refuse_own_folder(log, path)
    except OutputError as error:
        raise SigningError(f"{error}") from None


def _private_bytes(path: Path) -> bytes:
    """Return what is in a key's file, if it is its owner's alone, as ssh asks for it."""
    try:
        with os.fdopen(os.open(path, os.O_RDONLY | PLAIN), "rb") as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise SigningError(f"{path}: expected a private key, got no regular file.")
            if status.st_uid == os.getuid() and status.st_mode & _OTHERS:
                raise SigningError(
                    f"{path}: others may read this private key (mode "
                    f"{stat.S_IMODE(status.st_mode):04o}, expected 0600); if nobody has: "
                    f"chmod 600 {path}"
                )
            return file.read(_MOST_BYTES)
    except OSError as error:
        raise SigningError(f"{path}: the private key cannot be read: {error.strerror}.") from None


def _write_new(path: Path, data: bytes, mode: int) -> None:
    """Make a file that was not there, with these bytes, synced."""
    try:
        fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | NO_LINK | PLAIN, mode)
    except OSError as error:
        raise SigningError(f"{path}: the key cannot be made: {error.strerror}.") from None
    try:
        with os.fdopen(fd, "wb"):
            write_all(fd, data)
            os.fsync(fd)
    except BaseException as error:
        with suppress(OSError):
            path.unlink()
        if isinstance(error, OSError):
            raise SigningError(f"{path}: the key cannot be made: {error.strerror}.") from None
        raise
