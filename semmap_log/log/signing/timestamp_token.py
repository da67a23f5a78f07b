"""Time stamps of RFC 3161: the query for one, and what an answer says.

The signature in an answer is not checked here: `openssl ts -verify` does that, with the
certificate of the authority. Both are DER, of which this reads what it needs.
"""

from __future__ import annotations

import re
import secrets
from datetime import datetime

MOST_BYTES = 2**16
"""Of an answer; usual ones have 1 to 8 kB."""

_INTEGER, _OCTETS, _OID, _TIME, _SEQUENCE, _EXPLICIT = 0x02, 0x04, 0x06, 0x18, 0x30, 0xA0
_SHA256 = bytes.fromhex("608648016503040201")
_SIGNED_DATA = bytes.fromhex("2a864886f70d010702")
_TST_INFO = bytes.fromhex("2a864886f70d0109100104")
_VERSION_1 = bytes.fromhex("020101")
_WITH_CERTIFICATE = bytes.fromhex("0101ff")
_NONCE_BYTES = 8
_GRANTED = (b"\x00", b"\x01")
"""Granted; and granted with modifications."""
_FORM = re.compile(r"(\d{14})(\.\d{1,9})?Z", re.ASCII)

_Element = tuple[int, bytes]
"""A tag, and the bytes that it stands before."""


def query(digest: bytes) -> tuple[bytes, bytes]:
    """Return a query for a time stamp, and the random number that its answer has to repeat.

    It is the one of `openssl ts -query -sha256 -cert`, 69 bytes.

    Args:
        digest: SHA-256 of the text.
    """
    nonce = bytes([0x40 | secrets.randbits(6)]) + secrets.token_bytes(_NONCE_BYTES - 1)
    algorithm = _der(_SEQUENCE, _der(_OID, _SHA256) + b"\x05\x00")
    imprint = _der(_SEQUENCE, algorithm + _der(_OCTETS, digest))
    fields = _VERSION_1 + imprint + _der(_INTEGER, nonce) + _WITH_CERTIFICATE
    return _der(_SEQUENCE, fields), nonce


def stamped_time(answer: bytes, digest: bytes, *, nonce: bytes | None = None) -> str:
    """Return the time that an answer states: ISO-8601, UTC.

    Args:
        answer: As the authority sent it.
        digest: SHA-256 of the text that it has to be about.
        nonce: The number in the query; None: any.

    Raises:
        ValueError: It is no time stamp of that text.
    """
    info = _inside(_inside_one(_signed_bytes(answer)), _SEQUENCE)
    if _at(info, 0) != (_INTEGER, b"\x01"):
        raise ValueError("expected a time stamp of version 1")
    imprint = _inside(_at(info, 2), _SEQUENCE)
    algorithm = _inside(_at(imprint, 0), _SEQUENCE)
    if (_at(algorithm, 0), _at(imprint, 1)) != ((_OID, _SHA256), (_OCTETS, digest)):
        raise ValueError("it is a time stamp of another text: one of the two was altered")
    if nonce is not None and (_INTEGER, nonce) not in info[5:]:
        raise ValueError("it is the answer to another query")
    tag, time = _at(info, 4)
    return _iso(time.decode("ascii", "replace") if tag == _TIME else "")


def _signed_bytes(answer: bytes) -> bytes:
    """Return what the authority has signed: its TSTInfo."""
    parts = _inside(_inside_one(answer), _SEQUENCE)
    status = _inside(_at(parts, 0), _SEQUENCE)
    if (code := _at(status, 0))[0] != _INTEGER or code[1] not in _GRANTED:
        raise ValueError(f"the authority refuses it: status {code[1].hex()}{_words(status)}")
    signed = _content(_at(parts, 1), _SIGNED_DATA)
    tag, data = _content(_at(_inside(signed, _SEQUENCE), 2), _TST_INFO)
    if tag != _OCTETS:
        raise ValueError("what is signed in it is no time stamp")
    return data


def _content(element: _Element, kind: bytes) -> _Element:
    """Return what is in a ContentInfo of a kind."""
    parts = _inside(element, _SEQUENCE)
    if _at(parts, 0) != (_OID, kind):
        raise ValueError("what is in it is no time stamp")
    tag, data = _at(parts, 1)
    return _inside_one(data) if tag == _EXPLICIT else (0, b"")


def _words(status: list[_Element]) -> str:
    """Return what an authority says of why it refuses."""
    if len(status) < 2 or status[1][0] != _SEQUENCE:
        return ""
    texts = [text.decode("utf-8", "replace") for _, text in _elements(status[1][1])]
    return ", " + "; ".join(texts)


def _iso(text: str) -> str:
    found = _FORM.fullmatch(text)
    if found is None:
        raise ValueError("its time is not as it is written")
    time = datetime.strptime(found[1], "%Y%m%d%H%M%S")  # noqa: DTZ007 - Z
    return f"{time.isoformat()}{found[2] or ''}Z"


def _der(tag: int, data: bytes) -> bytes:
    return bytes([tag, len(data)]) + data


def _elements(data: bytes) -> list[_Element]:
    """Return the elements of DER bytes, one after the other.

    Raises:
        ValueError: They are cut, or of indefinite length.
    """
    found, place = [], 0
    while place < len(data):
        head = data[place : place + 2]
        if len(head) < 2 or head[1] in (0x80, 0xFF):
            raise ValueError("it is not DER, or cut")
        more = head[1] & 0x7F if head[1] & 0x80 else 0
        begin = place + 2 + more
        length = int.from_bytes(data[place + 2 : begin], "big") if more else head[1]
        place = begin + length
        if place > len(data):
            raise ValueError("it is not DER, or cut")
        found.append((head[0], data[begin:place]))
    return found


def _inside(element: _Element, tag: int) -> list[_Element]:
    if element[0] != tag:
        raise ValueError(f"expected the tag {tag:02x} of DER, got {element[0]:02x}")
    return _elements(element[1])


def _inside_one(data: bytes) -> _Element:
    found = _elements(data)
    if len(found) != 1:
        raise ValueError(f"expected one element of DER, got {len(found)}")
    return found[0]


def _at(elements: list[_Element], place: int) -> _Element:
    if place >= len(elements):
        raise ValueError(f"expected more than {place} elements of DER, got {len(elements)}")
    return elements[place]
