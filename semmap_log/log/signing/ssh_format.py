"""OpenSSH's strings (RFC 4251, section 5) and its armour of base64 lines."""

from __future__ import annotations

import base64
import struct

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
        """Return if nothing is left.

        Raises:
            ValueError: There is.
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
        ValueError: It is none of Ed25519.
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
