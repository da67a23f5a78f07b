"""The C library's calls on one folder: recorded, or made to end, to halve or to fail."""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
import struct
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from functools import cache
from pathlib import Path

from fault_injection.fault import CannotTryError

SOURCE = Path(__file__).with_suffix(".c")
FOR_EVER = 2**62


class Call(IntFlag):
    """The calls that change a folder, and LOOK: opening to read. The numbers are shim.c's."""

    OPEN = 1
    """Opening with O_CREAT or O_TRUNC."""
    WRITE = 2
    FSYNC = 4
    FDATASYNC = 8
    RENAME = 16
    UNLINK = 32
    TRUNCATE = 64
    MKDIR = 128
    CLOSE = 256
    LOOK = 512
    OTHER = 1024
    """Something that changes files in a way that the recording cannot hold."""
    NOTE = 2048
    """What the recorded program itself put in."""
    LINK = 4096
    """A file gets a second name."""


CHANGES = (
    Call.OPEN | Call.WRITE | Call.FSYNC | Call.FDATASYNC | Call.RENAME | Call.UNLINK
    | Call.TRUNCATE | Call.MKDIR | Call.LINK
)  # fmt: skip


class Action(IntEnum):
    """What happens at a call."""

    PASS = 0
    KILL = 1
    HALF_THEN_KILL = 2
    """A write's first half is done before the kill."""
    FAIL = 3
    HALF_THEN_FAIL = 4
    """A write's first half is done, and the whole is reported as failed."""
    SHORT = 5
    """A write does a half, and says so."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One recorded call, in the order in which they were done."""

    call: Call
    fd: int
    number: int
    """Offset of a write, new size, flags of an opening."""
    path: str
    other: str
    """A rename's target, or a second name."""
    data: bytes

    def describe(self) -> str:
        """Return it in a few words."""
        name = str(self.call.name).lower()
        if self.call == Call.WRITE:
            return f"{name} {len(self.data)} bytes at {self.number}"
        return f"{name} {Path(self.path).name}".strip()


_HEAD = struct.Struct("<IiqIIQ")


def built(folder: Path) -> Path:
    """Return the shim, compiled into that folder.

    Raises:
        CannotTryError: There is no C compiler.
    """
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        raise CannotTryError("needs a C compiler (cc or gcc)")
    library = folder / "shim.so"
    if not library.exists():
        command = [compiler, "-shared", "-fPIC", "-O2", "-o", str(library), str(SOURCE)]
        done = subprocess.run(
            [*command, "-ldl", "-lpthread"], capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise CannotTryError(f"the shim does not compile here: {done.stderr.strip()}")
    return library


@cache
def _library() -> ctypes.CDLL:
    library = ctypes.CDLL(os.environ["LD_PRELOAD"])
    library.shim_seen.restype = ctypes.c_long
    library.shim_note.argtypes = [ctypes.c_char_p, ctypes.c_size_t]
    library.shim_arm.argtypes = [
        ctypes.c_uint, ctypes.c_int, ctypes.c_long, ctypes.c_long, ctypes.c_int,
    ]  # fmt: skip
    return library


def watch(folder: Path, record_fd: int = -1) -> None:
    """From now on count the calls on files under `folder`; record them to that file."""
    _library().shim_watch(bytes(folder), record_fd)


def look_away() -> None:
    """Let everything pass, as before."""
    _library().shim_watch(b"", -1)
    disarm()


def arm(
    calls: Call, action: Action, first: int, count: int = 1, error: int = errno.EIO
) -> None:  # fmt: skip
    """Do that at the calls of these sorts from the `first` on, counted from 0 and from now."""
    _library().shim_arm(int(calls), int(action), first, min(first + count, FOR_EVER), error)


def count(calls: Call) -> None:
    """Count these calls from now on, and let them pass."""
    _library().shim_arm(int(calls), int(Action.PASS), 0, 0, 0)


def disarm() -> None:
    """Let everything pass."""
    _library().shim_arm(0, int(Action.PASS), 0, 0, 0)


def seen() -> int:
    """Return how many calls of the armed sorts there were."""
    return int(_library().shim_seen())


def note(text: str) -> None:
    """Put a line into the recording, between the calls before and after."""
    data = text.encode()
    _library().shim_note(data, len(data))


@contextmanager
def recorded(folder: Path) -> Iterator[list[Entry]]:
    """Record the calls on that folder; the list is filled when the block has ended."""
    entries: list[Entry] = []
    with tempfile.TemporaryFile() as file:
        watch(folder, file.fileno())
        try:
            yield entries
        finally:
            look_away()
        file.seek(0)
        entries += parse(file.read())


def parse(data: bytes) -> Iterator[Entry]:
    """Yield the calls of a recording."""
    at = 0
    while at < len(data):
        call, fd, number, path, other, size = _HEAD.unpack_from(data, at)
        names = at + _HEAD.size
        body = names + path + other
        yield Entry(
            Call(call),
            fd,
            number,
            os.fsdecode(data[names : names + path]),
            os.fsdecode(data[names + path : body]),
            data[body : body + size],
        )
        at = body + size
