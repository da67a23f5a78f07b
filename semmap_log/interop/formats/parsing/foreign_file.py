"""Opening a foreign file safely: what it is and how big it is are checked before its bytes.

A time that a wall clock shows twice is resolved by the order of the file.
"""

from __future__ import annotations

import gzip
import os
import re
import stat
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.io.disk import kind_of, open_plainly
from semmap_log.errors import FormatError

MIB = 2**20
BLOCK_BYTES = 2**20
GZIP_MAGIC = b"\x1f\x8b"

FREE_BYTES = 16 * MIB
"""So much a gzip file may hold, however few bytes it has."""
MOST_RATIO = 250
"""Beyond, only so many times its bytes: lines that say when something happened are packed a tenth
as small."""


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


def open_unpacked(path: Path) -> BinaryIO:
    """Open a regular file for reading; of a gzip file what is packed in it.

    Reading raises OSError, EOFError or zlib.error where a gzip file is damaged.

    Raises:
        FormatError: As `open_regular`; or a gzip file holds too much.
    """
    file = open_regular(path)
    is_gzip = file.read(2) == GZIP_MAGIC
    file.seek(0)
    if not is_gzip:
        return file
    try:
        _check_unpacked(path, file)
    except BaseException:
        file.close()
        raise
    file.seek(0)
    unpacked = gzip.GzipFile(fileobj=file)
    unpacked.myfileobj = file  # type: ignore[assignment]  # to be closed with it
    return cast("BinaryIO", unpacked)


def _check_unpacked(path: Path, file: BinaryIO) -> None:
    """Unpack a gzip file, to see before any of it is read that it holds no more than it may.

    That costs little compared to reading its lines, and a few kilobytes can contain many
    megabytes of them.

    Raises:
        FormatError: It holds more.
    """
    left = max(FREE_BYTES, MOST_RATIO * os.fstat(file.fileno()).st_size)
    with gzip.GzipFile(fileobj=file) as unpacked, suppress(OSError, EOFError, zlib.error):
        while left >= 0 and (block := unpacked.read1(BLOCK_BYTES)):
            left -= len(block)
    if left < 0:
        raise FormatError(
            path, f"expected at most {FREE_BYTES // MIB} MiB, or {MOST_RATIO} times its own bytes, "
            "unpacked; got more; unpack it yourself: gzip -d",
        )  # fmt: skip


def numbered_lines(path: Path, *, most_bytes: int) -> Iterator[tuple[int, str]]:
    """Yield number and text of each line that is not blank; a gzip file's are unpacked.

    Raises:
        FormatError: The file cannot be read, or a line is not UTF-8 or longer than `most_bytes`.
    """
    number, begun, size = 1, list[bytes](), 0
    with open_unpacked(path) as file:
        while True:
            try:
                block = file.read1(BLOCK_BYTES)  # type: ignore[attr-defined]
            except (OSError, EOFError, zlib.error) as error:
                raise FormatError(path, [(number, f"cannot be read on: {error}")]) from None
            lines, end, rest = block.rpartition(b"\n")
            if end or not block:
                lines = b"".join((*begun, lines, end, *([rest] if not block else [])))
                for place, line in _lines_in(lines):
                    if len(line) > most_bytes:
                        raise too_long(path, number + place, most_bytes)
                    yield number + place, decode_utf8(line, path, first_line=number + place)
                number, begun, size = number + lines.count(b"\n"), [], 0
            if not block:
                return
            begun.append(rest)
            size += len(rest)
            if size > most_bytes:
                raise too_long(path, number, most_bytes)


def _lines_in(block: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield each line that is not blank, with the number of lines before it."""
    before = at = 0
    for found in _NOT_BLANK.finditer(block):
        start = block.rfind(b"\n", 0, found.start()) + 1
        before, at = before + block.count(b"\n", at, start), start
        yield before, block[start : found.end()]


_NOT_BLANK = re.compile(rb"\S[^\n]*")


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


@dataclass(slots=True)
class FileOrder:
    """Goes along with the times of a file, or of a stream, and decides those that are not clear."""

    tz: str
    """The zone whose clock it is."""
    first: int = 0
    """So many times were taken for the first coming of the hour that comes twice."""
    second: int = 0
    """So many for the second."""
    _last_ns: int = 0
    _runs_forward: bool = True
    """No time was earlier than one before it."""

    def chosen(self, first_ns: int, second_ns: int, *, own_last_ns: int = 0) -> int:
        """Return the instant that the next time means: the first that keeps the order.

        Args:
            first_ns: What it can mean.
            second_ns: What else it can mean; elsewhere than in the hour that comes twice the same.
            own_last_ns: The last time of what it is about, such as its door. It alone counts in a
                file whose times run backwards.
        """
        chosen_ns = first_ns
        if first_ns != second_ns:
            last_ns = self._last_ns if self._runs_forward else 0
            if last_ns > second_ns:
                last_ns = own_last_ns
            if max(last_ns, own_last_ns) > first_ns:
                chosen_ns = second_ns
            self.second += chosen_ns == second_ns
            self.first += chosen_ns == first_ns
        self._runs_forward &= chosen_ns >= self._last_ns
        self._last_ns = max(self._last_ns, chosen_ns)
        return chosen_ns

    def pass_clear(self, times: NDArray[np.int64]) -> None:
        """Take note of the next times, which are clear."""
        self._runs_forward &= bool(times[0] >= self._last_ns and (np.diff(times) >= 0).all())
        self._last_ns = max(self._last_ns, int(times.max()))

    def warnings(self) -> tuple[str, ...]:
        """Return how many times were not clear, and for what they were taken; nothing: none."""
        count = self.first + self.second
        if not count:
            return ()
        told = (
            f"times in the hour that comes twice in {self.tz}: {count:,}; by the order of the file "
            f"{self.first:,} taken for its first coming, {self.second:,} for its second; times "
            "with an offset are clear"
        )
        return (told,)
