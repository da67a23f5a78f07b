"""Time stamps of statements: got from an authority by HTTP, and kept with the statement.

A statement names the one before it, so that one time stamp stands for all that its key signed
before: they are *not later than* that time.
"""

from __future__ import annotations

import http.client
import threading
import urllib.error
import urllib.request
from dataclasses import dataclass
from pathlib import Path

from semmap_log.core.io.disk import output_errors, read_own, replace_file
from semmap_log.errors import SigningError
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.signature_folder import TOKEN, SignedStatement, signed_in
from semmap_log.log.signing.statement import Statement
from semmap_log.log.signing.timestamp_token import MOST_BYTES, query, stamped_time
from semmap_log.store.reading.reader import LogReader

WITHIN_S = 60.0
"""So long an authority has to answer, with all that is read of it."""
_SCHEMES = ("http://", "https://")
_TYPE = "application/timestamp-query"


@dataclass(frozen=True, slots=True)
class Stamped:
    """A statement, and its time stamp."""

    path: Path
    """The statement."""
    time: str
    """ISO-8601, UTC, as the authority states it."""


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
        answer = read_own(token_file(one.path), MOST_BYTES)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ValueError(f"it cannot be read: {error.strerror}") from None
    return stamped_time(answer, bytes.fromhex(one.digest))


def token_file(statement: Path) -> Path:
    """Return where a statement's time stamp lies."""
    return statement.with_name(statement.name + TOKEN)


def is_url(text: str) -> bool:
    """Tell whether it is a URL that can be asked."""
    return text.startswith(_SCHEMES)


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
    with output_errors(file):
        if not one.path.exists():
            raise SigningError(f"{one.path}: a recorder replaced it meanwhile; try again.")
        replace_file(file, answer)
    return Stamped(one.path, time)


def _answer(url: str, wanted: bytes) -> bytes:
    """Return what an authority answers.

    Raises:
        OSError: It cannot be reached, refuses, sends too much, or too slowly.
        ValueError: The URL is none.
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
    request = urllib.request.Request(url, data=wanted, headers={"Content-Type": _TYPE})  # noqa: S310 - is_url
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
