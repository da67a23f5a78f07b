"""A file for a writer that cannot be trusted with a full disk.

Rerun writes from a thread of its own. When that fails to write, it tells stderr, and the program
may then wait for it for ever, or go on and leave a file without an end. So rerun gets a pipe, which
is never full, and the bytes go to the disk here, where an error is an error.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

PIECE_BYTES = 2**20


@contextmanager
def piped_to(path: Path) -> Iterator[PipeToFile]:
    """Hand out a pipe whose bytes go to the file; all of them are there when the block ends.

    Raises:
        OSError: The file cannot be written.
    """
    with path.open("wb") as file:
        pipe = PipeToFile(file)
        try:
            yield pipe
        finally:
            pipe.close()
        pipe.check()


class PipeToFile:
    """Copies a pipe to a file."""

    def __init__(self, file: BinaryIO) -> None:
        self._source, self._sink = os.pipe()
        self._file = file
        self._error: OSError | None = None
        self._thread = threading.Thread(target=self._copy, daemon=True)
        self._thread.start()

    @property
    def inlet(self) -> str:
        """The path to write to."""
        return f"/dev/fd/{self._sink}"

    def check(self) -> None:
        """Raise the OSError with which writing failed, if it did."""
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Wait for the last byte; whoever wrote has closed the inlet by now."""
        os.close(self._sink)
        self._thread.join()
        os.close(self._source)

    def _copy(self) -> None:
        while piece := os.read(self._source, PIECE_BYTES):
            if self._error is None:  # after an error the rest is drained, so that nobody waits
                try:
                    self._file.write(piece)
                    self._file.flush()
                except OSError as error:
                    self._error = error
