"""Where signatures lie: statements and their signatures, beside a log's segments.

    signatures/000000000216_9f86d081884c7d65_3.head      a statement: up to event 216, by that key
    signatures/000000000216_9f86d081884c7d65_3.head.sig  its signature
    signatures/000000000216_9f86d081884c7d65_3.head.tsr  its time stamp, if there is one
    signatures/000000000218_1f02c0aa91b37e5d_0.trim      one that vouches for what was taken out
    signatures/9f86d081884c7d65_4.revoke                 that key is revoked from its statement 4 on

The signature is written first: a statement that is there has one. Names only keep files apart;
what counts is in them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from semmap_log.core.io.disk import (
    left_by_killed,
    output_errors,
    read_own,
    replace_file,
    sync_folder,
)
from semmap_log.errors import SigningError
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.public_keys import key_in_words, short_id
from semmap_log.log.signing.revocation import TITLE, Revocation, read_revocation
from semmap_log.log.signing.ssh_signature import (
    HEADS,
    REVOKING,
    TRIMMING,
    SshSignature,
    read_signature,
    signature_of,
)
from semmap_log.log.signing.statement import OldStatement, Statement, read_statement

FOLDER = "signatures"
SUFFIXES = {HEADS: ".head", TRIMMING: ".trim", REVOKING: ".revoke"}
"""Namespace of a signature -> how the name of what is signed ends."""
SIGNATURE, TOKEN = ".sig", ".tsr"
"""What is added to the name of a statement: of its signature, and of its time stamp."""
_MOST_BYTES = 2**14


@dataclass(frozen=True, slots=True)
class SignedStatement:
    """A statement, and the signature that fits it."""

    path: Path
    statement: Statement | OldStatement
    digest: str
    """SHA-256 of its text, hexadecimal."""
    public_bytes: bytes
    """Of the key that signed it; whether that is believed is another question."""
    namespace: str


@dataclass(frozen=True, slots=True)
class SignedRevocation:
    """A revocation, and whose signature fits it."""

    path: Path
    revocation: Revocation
    public_bytes: bytes
    """Of the key that signed it; whether that is believed is another question."""


@dataclass(frozen=True, slots=True)
class BadSignature:
    """A file that is no signed statement or revocation, and why."""

    path: Path
    kind: str
    """`statement` or `signature`: what of the two is wrong."""
    problem: str


def statement_files(place: Path) -> list[Path]:
    """Return the files of statements in a folder; of the path of one itself.

    Raises:
        SigningError: There is no such file or folder, or it cannot be read.
    """
    try:
        if place.is_dir():
            return sorted(file for file in place.iterdir() if _is_statement(file))
        place.lstat()
    except OSError as error:
        raise SigningError(f"{place}: signatures cannot be read: {error.strerror}.") from None
    return [place]


def read_all(
    files: Iterable[Path],
) -> Iterator[SignedStatement | SignedRevocation | BadSignature]:
    """Yield what is in files of statements and revocations, each with its signature."""
    for file in files:
        yield read_signed(file)


def read_signed(file: Path) -> SignedStatement | SignedRevocation | BadSignature:
    """Return what a file states and who signed it; or what is wrong with that."""
    signature_file = file.with_name(file.name + SIGNATURE)
    try:
        text = _bytes_in(file)
        said = read_revocation(text) if text.startswith(TITLE) else read_statement(text)
    except (OSError, ValueError) as error:
        return BadSignature(file, "statement", _reason(error))
    try:
        signature = _signature_in(signature_file)
    except FileNotFoundError:
        return BadSignature(file, "signature", f"no {signature_file.name} lies beside it")
    except (OSError, ValueError) as error:
        return BadSignature(signature_file, "signature", _reason(error))
    if not signature.fits(text):
        problem = "the signature is not one of this text: one of the two was altered"
        return BadSignature(file, "signature", problem)
    if isinstance(said, Revocation) != (signature.namespace == REVOKING):
        problem = f"a signature of {signature.namespace} is not for what this file says"
        return BadSignature(file, "signature", problem)
    if isinstance(said, Revocation):
        return SignedRevocation(file, said, signature.public_bytes)
    digest = hashlib.sha256(text).hexdigest()
    return SignedStatement(file, said, digest, signature.public_bytes, signature.namespace)


def signed_in(log: Path, log_id: str = "") -> list[SignedStatement]:
    """Return the good statements in a log's folder; of one log only, if its id is given.

    Raises:
        SigningError: The folder cannot be read.
    """
    folder = folder_of(log)
    found = read_all(statement_files(folder)) if folder.is_dir() else ()
    good = [one for one in found if isinstance(one, SignedStatement)]
    return [one for one in good if log_id in ("", one.statement.log_id)]


def name_of(statement: Statement, key: SigningKey, namespace: str) -> str:
    """Return what the file of a statement is called."""
    last, whose = max(statement.next_event - 1, 0), short_id(key.public_bytes)
    return f"{last:012d}_{whose}_{statement.number}{SUFFIXES[namespace]}"


def name_of_revocation(said: Revocation) -> str:
    """Return what the file of a revocation is called."""
    return f"{short_id(key_in_words(said.key))}_{said.first}{SUFFIXES[REVOKING]}"


def write_signed(log: Path, name: str, text: str, key: SigningKey, namespace: str) -> Path:
    """Write a statement and its signature, each whole or not at all; return the statement's file.

    Raises:
        SigningError: Another statement has that name.
        OutputError: The disk does not take them.
    """
    folder = folder_of(log)
    path, data = folder / name, text.encode()
    with output_errors(path):
        if not folder.is_dir():
            folder.mkdir(exist_ok=True)
            sync_folder(log)
        if path.exists() and read_own(path) != data:
            raise SigningError(f"{path}: expected this key's statement, got another text.")
        _write(path.with_name(name + SIGNATURE), signature_of(data, key, namespace).encode())
        _write(path, data)
    return path


def remove_signed(log: Path, name: str) -> None:
    """Remove a statement that another stands for, and its signature; not one with a time stamp."""
    if (folder_of(log) / (name + TOKEN)).exists():
        return
    for each in (name, name + SIGNATURE):
        with suppress(OSError):
            (folder_of(log) / each).unlink()


def folder_of(log: Path) -> Path:
    """Return the folder of a log's signatures.

    Raises:
        SigningError: It is a link.
    """
    folder = log / FOLDER
    if folder.is_symlink():
        raise SigningError(f"{folder}: expected a folder of this log, got a link; remove it.")
    return folder


def _write(file: Path, data: bytes) -> None:
    for leftover in left_by_killed(file):
        with suppress(OSError):
            leftover.unlink()
    replace_file(file, data)


def _is_statement(file: Path) -> bool:
    return file.suffix in SUFFIXES.values() and not file.name.startswith(".")


def _signature_in(file: Path) -> SshSignature:
    return read_signature(_bytes_in(file).decode("ascii"))


def _bytes_in(file: Path) -> bytes:
    return read_own(file, _MOST_BYTES)


def _reason(error: OSError | ValueError) -> str:
    if isinstance(error, OSError):
        return f"it cannot be read: {error.strerror}"
    if isinstance(error, UnicodeDecodeError):
        return "a byte of it is not ASCII"
    return str(error)
