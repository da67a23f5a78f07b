"""Whom to believe: public keys, from a `.pub` file of OpenSSH or an allowed_signers file."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path

from semmap_log.errors import SigningError
from semmap_log.log.signing.ssh_format import KEY_TYPE, public_blob, public_bytes_in
from semmap_log.log.signing.ssh_signature import HEADS, NAMESPACES

_MOST_BYTES = 2**20
_NAMESPACES = re.compile(r'namespaces="([^"]*)"')


@dataclass(frozen=True, slots=True)
class PublicKey:
    """A key that is believed, and whose it is."""

    public_bytes: bytes
    owner: str = ""
    """The comment of a `.pub`, or the principals of an allowed_signers file."""
    namespaces: frozenset[str] = frozenset({HEADS})
    """What it is believed for: more than what was recorded only if a line names it."""

    @property
    def fingerprint(self) -> str:
        """Return it as `ssh-keygen -l` shows it: `SHA256:…`."""
        return fingerprint(self.public_bytes)

    @property
    def line(self) -> str:
        """Return it as the line of a `.pub` file."""
        blob = base64.b64encode(public_blob(self.public_bytes)).decode()
        return f"{KEY_TYPE} {blob} {self.owner}".rstrip() + "\n"

    @property
    def words(self) -> str:
        """Return it as it stands in a statement: without its owner."""
        return replace(self, owner="").line.strip()

    def __str__(self) -> str:
        return f"{self.owner} ({self.fingerprint})" if self.owner else self.fingerprint


def key_in_words(text: str) -> bytes:
    """Return the 32 bytes of a key that is written `ssh-ed25519 BASE64`.

    Raises:
        ValueError: It is none.
    """
    return _key_of(text.removeprefix(f"{KEY_TYPE} "))


def fingerprint(public_bytes: bytes) -> str:
    """Return a public key's fingerprint as `ssh-keygen -l` shows it."""
    digest = hashlib.sha256(public_blob(public_bytes)).digest()
    return "SHA256:" + base64.b64encode(digest).decode().rstrip("=")


def short_id(public_bytes: bytes) -> str:
    """Return 16 hexadecimal digits that tell keys apart in the names of files."""
    return hashlib.sha256(public_blob(public_bytes)).hexdigest()[:16]


def read_public_keys(paths: Iterable[Path]) -> Mapping[bytes, PublicKey]:
    """Return the keys in some files, by their bytes.

    Raises:
        SigningError: A file cannot be read, holds no key, or something that is none.
    """
    keys: dict[bytes, PublicKey] = {}
    for path in paths:
        found = [_key_in(path, number, line) for number, line in _lines(path)]
        if not found:
            raise SigningError(f"{path}: expected a public key ({KEY_TYPE} …), got none.")
        for key in found:
            known = keys.setdefault(key.public_bytes, key)
            both = known.namespaces | key.namespaces
            keys[key.public_bytes] = replace(known, namespaces=both)
    return keys


def _lines(path: Path) -> list[tuple[int, str]]:
    """Return the lines of a file that say something, with their numbers."""
    try:
        with path.open("rb") as file:
            text = file.read(_MOST_BYTES).decode("utf-8", "replace")
    except OSError as error:
        raise SigningError(f"{path}: the public key cannot be read: {error.strerror}.") from None
    if "PRIVATE KEY" in text:
        raise SigningError(f"{path}: expected a public key, got a private one; give its .pub file.")
    stripped = ((number, line.strip()) for number, line in enumerate(text.split("\n"), 1))
    return [(number, line) for number, line in stripped if line and not line.startswith("#")]


def _key_in(path: Path, number: int, line: str) -> PublicKey:
    """Return the key of a line: `[principals [options]] ssh-ed25519 BASE64 [comment]`."""
    before, behind = _parted(line)
    where = f"{path}, line {number}"
    blob, _, comment = behind.strip().partition(" ")
    try:
        key = _key_of(blob)
    except ValueError as error:
        raise SigningError(
            f"{where}: expected `{KEY_TYPE} BASE64`, as in a .pub file or allowed_signers: {error}."
        ) from None
    principals, _, options = before.partition(" ")
    return PublicKey(key, principals or comment.strip(), _namespaces(where, options.strip()))


def _parted(line: str) -> tuple[str, str]:
    """Return what stands before the kind of key, and what behind; behind nothing without it."""
    if line.startswith(f"{KEY_TYPE} "):
        return "", line.removeprefix(KEY_TYPE)
    before, _, behind = line.partition(f" {KEY_TYPE} ")
    return before.strip(), behind


def _key_of(text: str) -> bytes:
    """Return the key in base64.

    Raises:
        ValueError: It is none of Ed25519, or not as it is written.
    """
    if not text:
        raise ValueError("there is none in it")
    data = base64.b64decode(text, validate=True)
    key = public_bytes_in(data)
    if base64.b64encode(data).decode() != text:
        raise ValueError("its base64 is not as it is written")
    return key


def _namespaces(where: str, options: str) -> frozenset[str]:
    """Return what an allowed_signers line believes a key for.

    Raises:
        SigningError: It has other options, which are not understood here; or none of ours.
    """
    found = _NAMESPACES.fullmatch(options)
    if options and found is None:
        raise SigningError(
            f'{where}: of the options only namespaces="…" is understood here, got {options!r}; '
            "check with ssh-keygen -Y verify, or give the key without them."
        )
    patterns = found[1].split(",") if found else [HEADS]
    ours = [one for one in NAMESPACES if any(fnmatchcase(one, pattern) for pattern in patterns)]
    if not ours:
        raise SigningError(f"{where}: its namespaces allow none of {', '.join(NAMESPACES)}.")
    return frozenset(ours)
