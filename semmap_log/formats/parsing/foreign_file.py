"""Opening a foreign file safely: what it is and how big it is are checked before its bytes."""

from __future__ import annotations

import gzip
import os
import stat
import zlib
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import BinaryIO

from semmap_log.errors import FormatError
from semmap_log.io.disk import kind_of
from semmap_log.io.file_calls import open_plainly

MIB = 2**20
GZIP_MAGIC = b"\x1f\x8b"


def read_capped(path: Path, *, most_bytes: int) -> bytes:
    """Return the whole file.

    Raises:
        FormatError: It is missing, unreadable, not a regular file, or larger than `most_bytes`.
    """
    with open_regular(path) as file:
        try:
            data = file.read(most_bytes + 1)
        except OSError as error:
            raise _unreadable(path, error) from None
    if len(data) > most_bytes:
        raise FormatError(path, f"expected at most {most_bytes / MIB:g} MiB; this file is larger")
    return data


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading.

    Without O_NONBLOCK, opening a named pipe that nobody writes to would wait for ever.

    Raises:
        FormatError: It is missing, unreadable, or a folder, pipe, socket or device.
    """
    try:
        descriptor = open_plainly(path)
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    mode = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        raise FormatError(path, f"expected a regular file, got {kind_of(mode)}")
    return os.fdopen(descriptor, "rb")


def text_lines(path: Path, *, most_bytes: int) -> Iterator[str]:
    """Yield the file's lines with their ends, one at a time; a gzip file's are unpacked.

    Raises:
        FormatError: The file cannot be read, or a line is not UTF-8 or longer than `most_bytes`.
    """
    with open_regular(path) as raw:
        is_gzip = raw.read(2) == GZIP_MAGIC
        raw.seek(0)
        file: BinaryIO | gzip.GzipFile = gzip.GzipFile(fileobj=raw) if is_gzip else raw
        for number in count(1):
            try:
                line = file.readline(most_bytes + 1)
            except (OSError, EOFError, zlib.error) as error:
                raise FormatError(path, [(number, f"cannot be read on: {error}")]) from None
            if len(line) > most_bytes:
                raise too_long(path, number, most_bytes)
            if not line:
                return
            yield decode_utf8(line, path, first_line=number)


def too_long(path: Path, line: int, most_bytes: int) -> FormatError:
    """Return the error that says that a line is too long."""
    problem = f"expected lines of at most {most_bytes:,} bytes; this one is longer"
    return FormatError(path, [(line, problem)])


def decode_utf8(data: bytes, path: Path, *, first_line: int = 1) -> str:
    """Return the text, without a byte order mark at the file's start.

    Args:
        data: The bytes.
        path: For messages.
        first_line: The number of the first line in `data`.

    Raises:
        FormatError: It is not UTF-8; names the line.
    """
    try:
        return data.decode("utf-8-sig" if first_line == 1 else "utf-8")
    except UnicodeDecodeError as error:
        line = first_line + data.count(b"\n", 0, error.start)
        problem = f"expected UTF-8 text, got byte 0x{data[error.start]:02x}; save the file as UTF-8"
        raise FormatError(path, [(line, problem)]) from None


def _unreadable(path: Path, error: OSError | ValueError) -> FormatError:
    reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
    return FormatError(path, f"cannot be read: {reason}")
