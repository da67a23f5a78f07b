"""Where signatures lie: statements and their signatures, next to a log's segments.

    signatures/000000000216_9f86d081884c7d65_3.head      a statement: up to event 216, by that key
    signatures/000000000216_9f86d081884c7d65_3.head.sig  its signature
    signatures/000000000216_9f86d081884c7d65_3.head.tsr  its time stamp, if there is one
    signatures/000000000218_1f02c0aa91b37e5d_0.trim      one that vouches for what was taken out
    signatures/9f86d081884c7d65_4.revoke                 that key is revoked from its statement 4 on

The signature is written first: a statement that exists has one. Names only keep files apart; their
content counts.

Time stamps of statements come from an authority by HTTP, and are kept with the statement. A
statement names the one before it, so that one time stamp stands for all that its key signed
before: they are *not later than* that time.

A key can be revoked: from one of its statements on it is no longer believed about a log.

    semmap-log revocation 1
    log: 0f3c…
    key: ssh-ed25519 AAAA…
    from: 12
    last: 5e01…

It counts by the number of a statement, not by a date: who has stolen a key writes any date. `last`
is the SHA-256 of the newest statement before that number, which binds all that came before it: the
thief can sign other statements of lower numbers, but none in its place.

The signature is that of an owner's key, which is kept offline, in a namespace of its own.
"""

from __future__ import annotations

import hashlib
import http.client
import re
import threading
import urllib.request
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from semmap_log.core.io import disk
from semmap_log.core.io.url_path import is_http
from semmap_log.errors import SigningError
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.statement import (
    HEADS,
    KEY_TYPE,
    NO_DIGEST,
    REVOKING,
    TRIMMING,
    OldStatement,
    SshSignature,
    Statement,
    key_from_text,
    read_signature,
    read_statement,
    short_id,
    signature_of,
)
from semmap_log.log.signing.timestamp_token import MOST_BYTES, query, stamped_time
from semmap_log.store.reading.reader import LogReader

WITHIN_S = 60.0
"""So long an authority has to answer, with all that is read of it."""
_TYPE = "application/timestamp-query"


@dataclass(frozen=True, slots=True)
class Stamped:
    """A statement, and its time stamp."""

    path: Path
    """The statement."""
    time: str
    """ISO-8601, UTC, as the authority states it."""

    @property
    def file(self) -> Path:
        """Where the time stamp lies."""
        return token_file(self.path)


def stamp_newest(log: Path, key: SigningKey, url: str) -> Stamped | None:
    """Get a time stamp for the newest statement of a key, unless it has one.

    Args:
        log: The log's folder.
        key: Whose statement.
        url: Of the authority.

    Returns:
        None: the key has signed nothing of the log.

    Raises:
        SigningError: There is no answer, or it is no time stamp of the statement.
        OutputError: The disk does not take it.
    """
    own = [
        (one.statement.number, one) for one in signed_in(log, LogReader(log).info.log_id)
        if one.public_bytes == key.public_bytes and isinstance(one.statement, Statement)
    ]  # fmt: skip
    if not own:
        return None
    newest = max(own, key=lambda pair: pair[0])[1]
    try:
        had = time_of(newest)
    except ValueError as error:
        raise SigningError(f"{token_file(newest.path)}: {error}; remove it.") from None
    if had is not None:
        return Stamped(newest.path, had)
    return _stamp(newest, url)


def time_of(one: SignedStatement) -> str | None:
    """Return the time in a statement's time stamp, which nothing has checked; None: it has none.

    Raises:
        ValueError: What is there is no time stamp of it, or cannot be read.
    """
    try:
        answer = disk.read_own(token_file(one.path), MOST_BYTES)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ValueError(f"it cannot be read: {error.strerror}") from None
    return stamped_time(answer, bytes.fromhex(one.digest))


def token_file(statement: Path) -> Path:
    """Return where a statement's time stamp lies."""
    return statement.with_name(statement.name + TOKEN)


def _stamp(one: SignedStatement, url: str) -> Stamped:
    digest = bytes.fromhex(one.digest)
    wanted, nonce = query(digest)
    try:
        answer = _answer(url, wanted)
        time = stamped_time(answer, digest, nonce=nonce)
    except (OSError, ValueError, http.client.HTTPException) as error:
        problem = str(error) or type(error).__name__
        raise SigningError(
            f"{url}: no time stamp: {problem}. What is signed stays signed; try again later with "
            "the same command."
        ) from None
    file = token_file(one.path)
    with disk.output_errors(file):
        if not one.path.exists():
            raise SigningError(f"{one.path}: a recorder replaced it meanwhile; try again.")
        disk.replace_file(file, answer)
    return Stamped(one.path, time)


def _answer(url: str, wanted: bytes) -> bytes:
    """Return an authority's answer.

    Raises:
        OSError: It cannot be reached, refuses, sends too much, or too slowly.
        ValueError: It is not a URL.
        HTTPException: It does not speak HTTP.
    """
    found: list[bytes] = []
    problems: list[Exception] = []

    def work() -> None:
        try:
            found.append(_post(url, wanted))
        except Exception as error:  # noqa: BLE001 - raised by who waits
            problems.append(error)

    thread = threading.Thread(target=work, name="semmap_log time stamp", daemon=True)
    thread.start()
    thread.join(WITHIN_S)
    if problems:
        raise problems[0]
    if not found:
        raise OSError(f"the answer has no end within {WITHIN_S:g} s")
    return found[0]


def _post(url: str, wanted: bytes) -> bytes:
    if not is_http(url):
        raise ValueError("expected http://… or https://…")
    request = urllib.request.Request(url, data=wanted, headers={"Content-Type": _TYPE})  # noqa: S310 - checked
    try:
        with urllib.request.urlopen(request, timeout=WITHIN_S) as response:  # noqa: S310
            data: bytes = response.read(MOST_BYTES + 1)
    except urllib.error.HTTPError as error:
        raise OSError(f"the answer is {error.code} {error.reason}") from None
    except urllib.error.URLError as error:
        raise OSError(f"it cannot be reached: {error.reason}") from None
    if len(data) > MOST_BYTES:
        raise OSError(f"expected at most {MOST_BYTES:,} bytes, got more")
    return data


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
    return f"{short_id(key_from_text(said.key))}_{said.first}{SUFFIXES[REVOKING]}"


def write_signed(log: Path, name: str, text: str, key: SigningKey, namespace: str) -> Path:
    """Write a statement and its signature, each whole or not at all; return the statement's file.

    Raises:
        SigningError: Another statement has that name.
        OutputError: The disk does not take them.
    """
    folder = folder_of(log)
    path, data = folder / name, text.encode()
    with disk.output_errors(path):
        if not folder.is_dir():
            folder.mkdir(exist_ok=True)
            disk.sync_folder(log)
        if path.exists() and disk.read_own(path) != data:
            raise SigningError(f"{path}: expected this key's statement, got another text.")
        _write(path.with_name(name + SIGNATURE), signature_of(data, key, namespace).encode())
        _write(path, data)
    return path


def is_stamped(log: Path, name: str) -> bool:
    """Return whether a statement has a time stamp."""
    return token_file(folder_of(log) / name).exists()


def remove_signed(log: Path, name: str) -> None:
    """Remove a statement that another stands for, and its signature; not one with a time stamp."""
    if is_stamped(log, name):  # since a moment ago
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
    for leftover in disk.left_by_killed(file):
        with suppress(OSError):
            leftover.unlink()
    disk.replace_file(file, data)


def _is_statement(file: Path) -> bool:
    return file.suffix in SUFFIXES.values() and not file.name.startswith(".")


def _signature_in(file: Path) -> SshSignature:
    return read_signature(_bytes_in(file).decode("ascii"))


def _bytes_in(file: Path) -> bytes:
    return disk.read_own(file, _MOST_BYTES)


def _reason(error: OSError | ValueError) -> str:
    if isinstance(error, OSError):
        return f"it cannot be read: {error.strerror}"
    if isinstance(error, UnicodeDecodeError):
        return "a byte of it is not ASCII"
    return str(error)


TITLE = b"semmap-log revocation "
_FORM = re.compile(
    "semmap-log revocation 1\n"
    "log: ([0-9a-f]{32})\n"
    f"key: ({KEY_TYPE} [A-Za-z0-9+/=]+)\n"
    "from: (0|[1-9][0-9]{0,18})\n"
    "last: ([0-9a-f]{64})\n",
    re.ASCII,
)


@dataclass(frozen=True, slots=True)
class Revocation:
    """That the statements of a key about a log do not count from a number on."""

    log_id: str
    key: str
    """The public key, as a `.pub` has it, without a comment."""
    first: int
    """The number of the first statement that does not count."""
    last: str
    """SHA-256 of the last statement that counts, hexadecimal; zeros: none counts."""

    @property
    def text(self) -> str:
        """Return it as it is signed."""
        return (
            "semmap-log revocation 1\n"
            f"log: {self.log_id}\n"
            f"key: {self.key}\n"
            f"from: {self.first}\n"
            f"last: {self.last}\n"
        )

    @property
    def revokes_all(self) -> bool:
        """Whether no statement of the key counts."""
        return self.last == NO_DIGEST


def read_revocation(data: bytes) -> Revocation:
    """Return the revocation of a text, which has to be exactly as it is written.

    Raises:
        ValueError: It is not.
    """
    found = _FORM.fullmatch(data.decode("ascii", "replace"))
    if found is None:
        raise ValueError("no revocation of version 1 of a key, as it is written")
    log_id, key, first, last = found.groups()
    key_from_text(key)
    return Revocation(log_id, key, int(first), last)
