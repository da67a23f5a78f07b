"""What a segment is called in a store: its number, digits of its SHA-256, and a generation."""

from __future__ import annotations

import re

_HASH_DIGITS = 16
"""Of a segment's SHA-256 in its object's name."""


def object_name(number: int, sha256: str, generation: int = 0) -> str:
    """Return the name of a segment in a store.

    Args:
        number: Its number.
        sha256: Of its bytes, in hexadecimal digits.
        generation: That of the manifest by which it is sent; 0 is left out of the name.
    """
    later = f"-{generation}" if generation else ""
    return f"{number:06d}-{sha256[:_HASH_DIGITS]}{later}.mcap"


def is_object_name(name: str) -> bool:
    """Return whether that is the name of a shipped segment."""
    return _NAME.fullmatch(name) is not None


def generation_in(name: str) -> int:
    """Return the generation in a segment's name."""
    found = _NAME.fullmatch(name)
    return int(found[1] or 0) if found else 0


_NAME = re.compile(r"\d{6,}-[0-9a-f]{16}(?:-([1-9]\d*))?\.mcap")
