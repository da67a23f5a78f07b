"""What to say of bytes at which a library failed."""

from __future__ import annotations

import sqlite3

_SAYING = (OSError, ValueError, sqlite3.Error)
"""What these say is meant for people; of others it is a key, an offset, or nothing."""


def reason_of(error: BaseException) -> str:
    """Return in words why bytes cannot be read."""
    if isinstance(error, MemoryError):
        return "more memory is needed for it than there is"
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    if isinstance(error, UnicodeDecodeError):
        return f"expected UTF-8 text, got byte 0x{error.object[error.start]:02x} in it"
    is_librarys = type(error).__module__.split(".")[0] in {"rosbags", "apsw", "zstandard"}
    text = str(error).strip()
    if text and (is_librarys or isinstance(error, _SAYING)):
        return text
    return "its records contradict each other, or are cut"
