"""The one place that imports `cryptography`; without it, says how to get it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from semmap_log.errors import MissingExtraError, PassphraseError, SigningError

try:
    from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
    from cryptography.hazmat.primitives import serialization
    from cryptography.hazmat.primitives.asymmetric.ed25519 import (
        Ed25519PrivateKey,
        Ed25519PublicKey,
    )
except ImportError:
    raise MissingExtraError("cryptography", "sign") from None


class SigningKey:
    """A private key of Ed25519. It shows nothing of itself."""

    def __init__(self, key: Ed25519PrivateKey, path: Path | None = None) -> None:
        self._key = key
        self.path = path
        """The file of the private key; None: it has none."""

    @classmethod
    def drawn(cls) -> SigningKey:
        """Return a new key."""
        return cls(Ed25519PrivateKey.generate())

    @classmethod
    def of_openssh(cls, data: bytes, *, passphrase: str | None = None) -> SigningKey:
        """Return the key in a private key file of OpenSSH.

        Raises:
            PassphraseError: It is encrypted, and the passphrase is missing or wrong.
            MissingExtraError: It is encrypted, and a package to open it is not installed.
            SigningError: It is no such key.
        """
        secret = passphrase.encode() if passphrase else None
        key = _loaded(data, secret)
        if not isinstance(key, Ed25519PrivateKey):
            raise SigningError("expected a key of Ed25519 (ssh-keygen -t ed25519), got another")
        return cls(key)

    def to_openssh(self) -> bytes:
        """Return the private key as a file of OpenSSH, without a passphrase."""
        return self._key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.OpenSSH,
            serialization.NoEncryption(),
        )

    @property
    def public_bytes(self) -> bytes:
        """The public key, 32 bytes."""
        return self._key.public_key().public_bytes(
            serialization.Encoding.Raw, serialization.PublicFormat.Raw
        )

    def sign(self, data: bytes) -> bytes:
        """Return the signature, 64 bytes; always the same for the same data."""
        return self._key.sign(data)


def is_signed_by(public_bytes: bytes, signature: bytes, data: bytes) -> bool:
    """Return whether a signature of 64 bytes is that of a public key of 32 bytes for the data."""
    try:
        Ed25519PublicKey.from_public_bytes(public_bytes).verify(signature, data)
    except (InvalidSignature, ValueError):
        return False
    return True


def _loaded(data: bytes, secret: bytes | None) -> Any:
    try:
        return serialization.load_ssh_private_key(data, secret)
    except UnsupportedAlgorithm as error:
        if "bcrypt" in str(error):
            raise MissingExtraError("bcrypt", "sign") from None
        raise SigningError("expected a key of Ed25519, got one of a kind unknown here") from None
    except (ValueError, TypeError) as error:
        if b"OPENSSH PRIVATE KEY" not in data:
            raise SigningError("expected a private key of OpenSSH, got something else") from None
        if secret is None and "password" in str(error).lower():
            raise PassphraseError("it is encrypted; its passphrase is needed") from None
        if secret is not None:
            raise PassphraseError("it cannot be opened with this passphrase") from None
        raise SigningError("its private key cannot be read: the file is damaged") from None
