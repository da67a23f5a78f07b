"""A signature of OpenSSH, as `ssh-keygen -Y sign` makes it and `-Y verify` checks it.

The format is that of PROTOCOL.sshsig in OpenSSH's sources. What is signed is not the text, but a
hash of it with a *namespace*, so that a signature for one purpose cannot serve another.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

from semmap_log.log.signing.ed25519_sdk import SigningKey, is_signed_by
from semmap_log.log.signing.ssh_format import (
    StringReader,
    armoured,
    public_blob,
    public_bytes_in,
    signature_blob,
    signature_bytes_in,
    string,
    unarmoured,
)

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
        """Tell whether that key has signed this text."""
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
    """Return what is in a signature's file; whether it fits a text is asked of that.

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
