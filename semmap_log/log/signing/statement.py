"""What is signed: a few lines that people can read, about a log up to one of its commits.

    semmap-log statement 2
    log: 0f3c…
    number: 3
    commits: 41
    next-event: 217
    head: c16b…
    taken: 5e01…
    adopted: none
    before: 0000…
    next-key: none

Through the hash chain `head` stands for every event below `next-event` of which nothing was taken
out; `taken` for the rest: what was taken out, and what no commit binds (`store.header`). Segments
are not named: small ones are continued, and merged; events keep their numbers.

Also the formats for it: OpenSSH's strings (RFC 4251, section 5) and its armour of base64 lines; a
signature as `ssh-keygen -Y sign` makes it and `-Y verify` checks it; and whom to believe: public
keys, from a `.pub` file of OpenSSH or an allowed_signers file.

A signature has the format of PROTOCOL.sshsig in OpenSSH's sources. What is signed is not the text,
but a hash of it with a *namespace*, so that a signature for one purpose cannot serve another.
"""

from __future__ import annotations

import base64
import hashlib
import re
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path

from semmap_log.core.model.moments import format_utc
from semmap_log.errors import SigningError
from semmap_log.log.signing.ed25519_sdk import SigningKey, is_signed_by
from semmap_log.store.byte_layout import NO_HASH
from semmap_log.store.verification.findings import CommitEnd

KEY_TYPE = "ssh-ed25519"
PUBLIC_BYTES = 32
SIGNATURE_BYTES = 64

_BEGIN = "-----BEGIN SSH SIGNATURE-----\n"
_END = "-----END SSH SIGNATURE-----\n"
_LINE = 70


class StringReader:
    """Takes strings from bytes, one after the other."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def take(self, count: int) -> bytes:
        """Return the next bytes.

        Raises:
            ValueError: There are fewer.
        """
        taken, self._data = self._data[:count], self._data[count:]
        if len(taken) != count:
            raise ValueError(f"expected {count} bytes more, got {len(taken)}")
        return taken

    def string(self) -> bytes:
        """Return the next string.

        Raises:
            ValueError: It is cut.
        """
        (length,) = struct.unpack(">I", self.take(4))
        return self.take(length)

    def end(self) -> None:
        """Check that nothing is left.

        Raises:
            ValueError: Something is.
        """
        if self._data:
            raise ValueError(f"{len(self._data)} bytes more than it should have")


def string(data: bytes) -> bytes:
    """Return a string: its length, and its bytes."""
    return struct.pack(">I", len(data)) + data


def public_blob(public_bytes: bytes) -> bytes:
    """Return a public key as OpenSSH writes it."""
    return string(KEY_TYPE.encode()) + string(public_bytes)


def public_bytes_in(blob: bytes) -> bytes:
    """Return the 32 bytes of a public key.

    Raises:
        ValueError: It is no key of Ed25519.
    """
    return _only(blob, PUBLIC_BYTES)


def signature_blob(signature: bytes) -> bytes:
    """Return a signature as OpenSSH writes it."""
    return string(KEY_TYPE.encode()) + string(signature)


def signature_bytes_in(blob: bytes) -> bytes:
    """Return the 64 bytes of a signature.

    Raises:
        ValueError: It is no signature of Ed25519.
    """
    return _only(blob, SIGNATURE_BYTES)


def armoured(blob: bytes) -> str:
    """Return the text of a signature's file."""
    text = base64.b64encode(blob).decode()
    lines = [text[i : i + _LINE] + "\n" for i in range(0, len(text), _LINE)]
    return "".join((_BEGIN, *lines, _END))


def unarmoured(text: str) -> bytes:
    """Return what is in a signature's file, which has to be as OpenSSH writes it, byte for byte.

    Raises:
        ValueError: It is not.
    """
    inner = text.removeprefix(_BEGIN).removesuffix(_END)
    blob = base64.b64decode(inner.replace("\n", ""), validate=True)
    if armoured(blob) != text:
        raise ValueError("its lines are not as ssh-keygen writes them")
    return blob


def _only(blob: bytes, length: int) -> bytes:
    strings = StringReader(blob)
    kind, data = strings.string(), strings.string()
    strings.end()
    if kind != KEY_TYPE.encode() or len(data) != length:
        raise ValueError(f"expected {KEY_TYPE}, got {kind.decode('ascii', 'replace')!r}")
    return data


NONE = "none"
NO_DIGEST = NO_HASH.hex()
_NUMBER = "0|[1-9][0-9]{0,18}"
_HASH = "[0-9a-f]{64}"
_TIME = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{9}Z"
_FORM = re.compile(
    "semmap-log statement 2\n"
    "log: ([0-9a-f]{32})\n"
    f"number: ({_NUMBER})\n"
    f"commits: ({_NUMBER})\n"
    f"next-event: ({_NUMBER})\n"
    f"head: ({_HASH})\n"
    f"taken: ({_HASH})\n"
    rf"adopted: ({NONE}|(?:{_NUMBER})\.\.(?:{_NUMBER}))" + "\n"
    f"before: ({_HASH})\n"
    f"next-key: ({NONE}|{KEY_TYPE} [A-Za-z0-9+/=]+)\n",
    re.ASCII,
)
_FORM_1 = re.compile(
    "semmap-log head 1\n"
    "log: ([0-9a-f]{32})\n"
    f"first-event: ({_NUMBER})\n"
    f"next-event: ({_NUMBER})\n"
    f"commits: ({_NUMBER})\n"
    f"recorded: ({_TIME})\n"
    f"previous-head: ({_HASH})\n"
    f"head: ({_HASH})\n",
    re.ASCII,
)


@dataclass(frozen=True, slots=True)
class Statement:
    """That a log holds so many events, which commit is the last, and what was taken out."""

    log_id: str
    number: int
    """It rises with each statement of a key about a log."""
    commits: int
    """Up to its last, with those that were taken out."""
    next_event: int
    """The number after its last event."""
    head: str
    """Hash of its last commit, hexadecimal."""
    taken: str
    """Digest of what was taken out, and of what no commit binds, hexadecimal."""
    adopted: tuple[int, int] | None
    """First and last of the events that the signer found there, and neither wrote nor verified."""
    before: str
    """SHA-256 of the key's last statement about the log that is kept, hexadecimal; else zeros."""
    next_key: str = NONE
    """The public key that goes on in the place of this one, as a `.pub` has it."""

    @property
    def text(self) -> str:
        """Return it as it is signed."""
        adopted = NONE if self.adopted is None else f"{self.adopted[0]}..{self.adopted[1]}"
        return (
            "semmap-log statement 2\n"
            f"log: {self.log_id}\n"
            f"number: {self.number}\n"
            f"commits: {self.commits}\n"
            f"next-event: {self.next_event}\n"
            f"head: {self.head}\n"
            f"taken: {self.taken}\n"
            f"adopted: {adopted}\n"
            f"before: {self.before}\n"
            f"next-key: {self.next_key}\n"
        )

    def agrees(self, end: CommitEnd, *, counts_all: bool) -> bool:
        """Return whether a log that was read has what this states besides the head.

        Args:
            end: Of the commit that it names.
            counts_all: Whether the reading began with the log's first commit.
        """
        return not counts_all or self.commits == end.commits


@dataclass(frozen=True, slots=True)
class OldStatement:
    """A statement of version 1: it does not say what was taken out. None is made any more."""

    log_id: str
    first_event: int
    """With which the stretch begins."""
    next_event: int
    """The number after its last event."""
    commits: int
    """In the stretch."""
    recorded: str
    """When its last commit was recorded: ISO-8601, UTC, nanoseconds."""
    previous_head: str
    """Hash of the commit before the stretch, hexadecimal."""
    head: str
    """Hash of its last commit, hexadecimal."""

    def agrees(self, start: CommitEnd, end: CommitEnd) -> bool:
        """Return whether a log has what this states besides the head, between two commits."""
        assert end.recorded_ns is not None, "the commit is there"
        said = (self.commits, self.recorded, self.previous_head)
        found = end.commits - start.commits, format_utc(end.recorded_ns), start.head.hex()
        return said == found


def read_statement(data: bytes) -> Statement | OldStatement:
    """Return the statement of a text, which has to be exactly as it is written.

    Raises:
        ValueError: It is not.
    """
    text = data.decode("ascii", "replace")
    if found := _FORM_1.fullmatch(text):
        log_id, first, end, commits, recorded, previous, head = found.groups()
        return OldStatement(log_id, int(first), int(end), int(commits), recorded, previous, head)
    found = _FORM.fullmatch(text)
    if found is None:
        raise ValueError("no statement of version 1 or 2 about a log, as it is written")
    log_id, number, commits, end, head, taken, adopted, before, next_key = found.groups()
    return Statement(
        log_id, int(number), int(commits), int(end), head, taken, _range(adopted), before, next_key
    )


def _range(text: str) -> tuple[int, int] | None:
    if text == NONE:
        return None
    first, _, last = text.partition("..")
    return int(first), int(last)


HEADS, TRIMMING, REVOKING = "semmap-log", "semmap-log-trim", "semmap-log-revoke"
"""Namespaces: of statements about what was recorded; of those that also vouch for what was taken
out; and of revocations of keys. A key that is believed for the first removes nothing."""
NAMESPACES = (HEADS, TRIMMING, REVOKING)

_MAGIC = b"SSHSIG"
_VERSION = (1).to_bytes(4, "big")
_HASHES = ("sha256", "sha512")
_OUR_HASH = "sha512"


@dataclass(frozen=True, slots=True)
class SshSignature:
    """What is in a signature's file."""

    public_bytes: bytes
    """Of the key that signed, as the file says."""
    namespace: str
    hash_name: str
    signature: bytes

    def fits(self, text: bytes) -> bool:
        """Return whether that key has signed this text."""
        signed = _signed(text, self.namespace, self.hash_name)
        return is_signed_by(self.public_bytes, self.signature, signed)


def signature_of(text: bytes, key: SigningKey, namespace: str = HEADS) -> str:
    """Return the file of a signature; always the same for the same text and key."""
    blob = (
        _MAGIC
        + _VERSION
        + string(public_blob(key.public_bytes))
        + string(namespace.encode())
        + string(b"")
        + string(_OUR_HASH.encode())
        + string(signature_blob(key.sign(_signed(text, namespace, _OUR_HASH))))
    )
    return armoured(blob)


def read_signature(text: str) -> SshSignature:
    """Return the content of a signature's file; `fits` checks it against a text.

    Raises:
        ValueError: It is no signature of Ed25519 in one of our namespaces.
    """
    strings = StringReader(unarmoured(text))
    if strings.take(len(_MAGIC) + len(_VERSION)) != _MAGIC + _VERSION:
        raise ValueError("no SSH signature of version 1")
    public, namespace, reserved, hash_name, signature = (strings.string() for _ in range(5))
    strings.end()
    name = namespace.decode("utf-8", "replace")
    if name not in NAMESPACES:
        raise ValueError(f"expected the namespace {' or '.join(NAMESPACES)}, got {name!r}")
    if reserved or hash_name.decode("ascii", "replace") not in _HASHES:
        raise ValueError(f"expected a hash of {' or '.join(_HASHES)}, got {hash_name!r}")
    return SshSignature(
        public_bytes_in(public), name, hash_name.decode(), signature_bytes_in(signature)
    )


def _signed(text: bytes, namespace: str, hash_name: str) -> bytes:
    """Return the bytes that are signed in the place of a text."""
    digest = hashlib.new(hash_name, text).digest()
    parts = (namespace.encode(), b"", hash_name.encode(), digest)
    return _MAGIC + b"".join(map(string, parts))


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


def key_from_text(text: str) -> bytes:
    """Return the 32 bytes of a key that is written `ssh-ed25519 BASE64`.

    Raises:
        ValueError: It is no such key.
    """
    return _key_of(text.removeprefix(f"{KEY_TYPE} "))


def fingerprint(public_bytes: bytes) -> str:
    """Return a public key's fingerprint as `ssh-keygen -l` shows it."""
    digest = hashlib.sha256(public_blob(public_bytes)).digest()
    return "SHA256:" + base64.b64encode(digest).decode().rstrip("=")


def short_id(public_bytes: bytes) -> str:
    """Return 16 hexadecimal digits that distinguish keys in the names of files."""
    return hashlib.sha256(public_blob(public_bytes)).hexdigest()[:16]


def read_public_keys(paths: Iterable[Path]) -> Mapping[bytes, PublicKey]:
    """Return the keys in some files, by their bytes.

    Raises:
        SigningError: A file cannot be read, holds no key, or something that is no key.
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
    """Return the text before the kind of key and the text after it ("" without it)."""
    if line.startswith(f"{KEY_TYPE} "):
        return "", line.removeprefix(KEY_TYPE)
    before, _, behind = line.partition(f" {KEY_TYPE} ")
    return before.strip(), behind


def _key_of(text: str) -> bytes:
    """Return the key in base64.

    Raises:
        ValueError: It is no key of Ed25519, or not as it is written.
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
