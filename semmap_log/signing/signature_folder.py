"""Where signatures lie: statements and their signatures, beside a log's segments.

    signatures/000000000216_9f86d081884c7d65.head      a statement: up to event 216, by that key
    signatures/000000000216_9f86d081884c7d65.head.sig  its signature

The signature is written first: a statement that is there has one. Names only keep files apart;
what counts is in them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from semmap_log.errors import SigningError
from semmap_log.io.disk import left_by_killed, output_errors, read_own, replace_file, sync_folder
from semmap_log.signing.ed25519_sdk import SigningKey
from semmap_log.signing.head_statement import HeadStatement, read_statement
from semmap_log.signing.public_keys import short_id
from semmap_log.signing.ssh_signature import SshSignature, read_signature, signature_of

FOLDER = "signatures"
STATEMENT, SIGNATURE = ".head", ".sig"
_NAME = re.compile(r"(\d{12,19})_([0-9a-f]{16})\.head", re.ASCII)
_MOST_BYTES = 2**14


@dataclass(frozen=True, slots=True)
class SignedStatement:
    """A statement, and the signature that fits it."""

    path: Path
    statement: HeadStatement
    public_bytes: bytes
    """Of the key that signed it; whether that is believed is another question."""


@dataclass(frozen=True, slots=True)
class BadSignature:
    """A file that is no signed statement, and why."""

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


def read_all(files: Iterable[Path]) -> Iterator[SignedStatement | BadSignature]:
    """Yield what is in files of statements, each with the signature beside it."""
    for file in files:
        yield read_signed(file)


def read_signed(file: Path) -> SignedStatement | BadSignature:
    """Return what a file states and who signed it; or what is wrong with that."""
    signature_file = file.with_name(file.name + SIGNATURE)
    try:
        text = _bytes_in(file)
        statement = read_statement(text)
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
    return SignedStatement(file, statement, signature.public_bytes)


def last_signed(log: Path, key: SigningKey) -> SignedStatement | None:
    """Return the statement of a key that reaches farthest; None: it has signed nothing here.

    Raises:
        SigningError: It cannot be read, was altered, or is another key's.
    """
    folder = _folder_of(log)
    if not folder.is_dir():
        return None
    ours = short_id(key.public_bytes)
    named = ((_NAME.fullmatch(file.name), file) for file in statement_files(folder))
    reach = [(int(name[1]), file) for name, file in named if name and name[2] == ours]
    if not reach:
        return None
    found = read_signed(max(reach)[1])
    if isinstance(found, BadSignature):
        raise SigningError(f"{found.path}: {found.problem}. Nothing is signed on top of it.")
    if found.public_bytes != key.public_bytes:
        raise SigningError(f"{found.path}: is signed by another key than its name says.")
    return found


def write_signed(log: Path, statement: HeadStatement, key: SigningKey) -> Path:
    """Write a statement and its signature, each whole or not at all; return the statement's file.

    Raises:
        SigningError: This key has said otherwise of this event.
        OutputError: The disk does not take them.
    """
    folder = _folder_of(log)
    name = f"{statement.next_event - 1:012d}_{short_id(key.public_bytes)}{STATEMENT}"
    path, text = folder / name, statement.text.encode()
    with output_errors(path):
        if not folder.is_dir():
            folder.mkdir(exist_ok=True)
            sync_folder(log)
        if path.exists() and read_own(path) != text:
            raise SigningError(f"{path}: this key has signed something else of this event.")
        _write(path.with_name(name + SIGNATURE), signature_of(text, key).encode())
        _write(path, text)
    return path


def _write(file: Path, data: bytes) -> None:
    for leftover in left_by_killed(file):
        with suppress(OSError):
            leftover.unlink()
    replace_file(file, data)


def _folder_of(log: Path) -> Path:
    folder = log / FOLDER
    if folder.is_symlink():
        raise SigningError(f"{folder}: expected a folder of this log, got a link; remove it.")
    return folder


def _is_statement(file: Path) -> bool:
    return file.name.endswith(STATEMENT) and not file.name.startswith(".")


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
