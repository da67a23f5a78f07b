"""A log in a zip file, unpacked into a temporary folder for as long as it is read.

A mapped file needs a file, and most queries need parts of it in no order: so the log's files are
unpacked, once, into a folder of their own among the machine's temporary files (TMPDIR). The last
reader removes it. Only a log's own files are unpacked, under the names that they have in one
folder: no name in a zip leads anywhere else.

Whoever packed it is a stranger: all files together may hold a hundred times the zip's bytes, or
128 MiB if that is more; nothing is unpacked further, and no more than a MiB is in memory.
"""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
import weakref
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from semmap_log.core.io.disk import open_plainly
from semmap_log.errors import CorruptLogError, LogAccessError, LogError, NotALogError
from semmap_log.store.form import BAG_METADATA_NAME, KEPT_SUFFIX, REMOVED_NAME, is_mark_name

FREE_BYTES = 128 * 2**20
MOST_RATIO = 100
MOST_LIST_BYTES = 4 * 2**20
"""Of the list of files at the zip's end, which is held in memory."""
PIECE_BYTES = 2**20

_KNOWN = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_ENCRYPTED = 1

Version = tuple[int, int, int, int]


class UnpackedLog:
    """The folder of a zipped log's files; it is removed with the last reference to this."""

    def __init__(self, path: Path) -> None:
        """Unpack a zip file.

        Raises:
            NotALogError: There is no log in it, or more than one.
            LogError: It cannot be unpacked.
            LogAccessError: It cannot be read, or there is no room for its files.
        """
        self._folder = tempfile.TemporaryDirectory(prefix="semmap-log-unzipped-")
        self.path = Path(self._folder.name)
        try:
            _unpack(path, self.path)
        except BaseException:
            self._folder.cleanup()
            raise


_unpacked: weakref.WeakValueDictionary[Version, UnpackedLog] = weakref.WeakValueDictionary()
"""What is being read: two readers of a zip share one unpacked copy."""


def unpacked(path: Path) -> UnpackedLog:
    """Return the log in a zip file, unpacked now or before.

    Raises:
        LogError: As for `UnpackedLog`.
    """
    status = path.stat()
    version = status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns
    found = _unpacked.get(version)
    if found is None:
        found = _unpacked[version] = UnpackedLog(path)
    return found


def _unpack(path: Path, folder: Path) -> None:
    with _opened(path) as file:
        most = max(FREE_BYTES, MOST_RATIO * os.fstat(file.fileno()).st_size)
        try:
            with zipfile.ZipFile(_Guarded(path, file)) as packed:
                members = _members_of_log(path, packed)
                _check_sizes(path, members, most, folder)
                for member in members:
                    most -= _unpack_one(path, packed, member, folder, most)
        except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, ValueError) as error:
            raise CorruptLogError(path, None, f"no zip file that can be read: {error}") from None


def _members_of_log(path: Path, packed: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    """Return the files of the one log in it.

    Raises:
        NotALogError: It contains no log, or more than one.
        LogError: A name leads out of the zip, or comes twice, or is that of no plain file.
    """
    files = [one for one in packed.infolist() if not one.is_dir()]
    for one in files:
        if not _stays_inside(one.filename):
            raise LogError(f"{path}: refused: it holds {one.filename!r}, which leads out of it.")
    places = {one.filename: PurePosixPath(one.filename) for one in files}
    homes = {
        place.parent
        for place in places.values()
        if place.suffix == ".mcap" and not place.name.startswith(".")
    }
    logs = sorted(home for home in homes if not homes & set(home.parents))  # not `damaged-1` in it
    if len(logs) != 1:
        raise NotALogError(_wrong_count(path, [str(home) for home in logs]))
    mine = [one for one in files if places[one.filename].parent == logs[0]]
    wanted = [one for one in mine if _is_of_log(places[one.filename].name)]
    _check_kinds(path, wanted)
    return wanted


def _wrong_count(path: Path, logs: list[str]) -> str:
    if not logs:
        return f"{path}: no log in this zip file: expected a folder with segments (*.mcap)."
    named = ", ".join(logs[:4]) + (", …" if len(logs) > 4 else "")
    found = f"{len(logs)}: {named}"
    return f"{path}: expected one log in a zip file, got {found}; unpack it, and ask one of them."


def _stays_inside(name: str) -> bool:
    is_plain = bool(name) and "\\" not in name and "\0" not in name and not name.startswith("/")
    return is_plain and ".." not in name.split("/") and ":" not in name.split("/", maxsplit=1)[0]


def _is_of_log(name: str) -> bool:
    is_segment = name.endswith((".mcap", KEPT_SUFFIX)) and not name.startswith(".")
    return is_segment or is_mark_name(name) or name in (BAG_METADATA_NAME, REMOVED_NAME)


def _check_kinds(path: Path, members: list[zipfile.ZipInfo]) -> None:
    names = set()
    for one in members:
        kind = stat.S_IFMT(one.external_attr >> 16)
        problem = ""
        if kind not in (0, stat.S_IFREG):
            problem = "is no plain file"
        elif one.flag_bits & _ENCRYPTED:
            problem = "is encrypted; unpack it with its password first"
        elif one.compress_type not in _KNOWN:
            problem = "is packed neither stored nor deflated; pack it so"
        elif one.filename in names:
            problem = "is there twice"
        if problem:
            raise LogError(f"{path}: {one.filename!r} {problem}.")
        names.add(one.filename)


def _check_sizes(path: Path, members: list[zipfile.ZipInfo], most: int, folder: Path) -> None:
    """Look at what the zip says of itself before anything is unpacked."""
    size = sum(one.file_size for one in members)
    if size > most:
        raise _too_much(path, f"{size:,} bytes", most)
    free = shutil.disk_usage(folder).free
    if size > free:
        raise LogAccessError(
            f"{path}: its files need {size:,} bytes in {folder.parent}, where {free:,} are free; "
            "set TMPDIR to a folder with more room, or unpack it yourself."
        )


def _unpack_one(
    path: Path, packed: zipfile.ZipFile, member: zipfile.ZipInfo, folder: Path, most: int
) -> int:
    """Unpack a file, and return how many bytes it has: no more than `most`, whatever it says."""
    done = 0
    target = folder / PurePosixPath(member.filename).name
    with packed.open(member) as source, target.open("xb") as file:
        while piece := source.read(PIECE_BYTES):
            done += len(piece)
            if done > most:
                raise _too_much(path, "more", most)
            _write(path, file, piece)
    return done


def _write(path: Path, file: BinaryIO, piece: bytes) -> None:
    try:
        file.write(piece)
    except OSError as error:
        raise LogAccessError(f"{path}: cannot be unpacked: {error.strerror}.") from error


def _too_much(path: Path, got: str, most: int) -> LogError:
    return LogError(
        f"{path}: refused: expected files of at most {most:,} bytes together ({MOST_RATIO} times "
        f"the zip's, or {FREE_BYTES // 2**20} MiB), got {got}; a log is never packed as small."
    )


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    try:
        with os.fdopen(open_plainly(path), "rb") as file:
            yield file
    except LogError:
        raise
    except OSError as error:
        raise LogAccessError(f"{path}: cannot be read: {error.strerror or error}.") from error


class _Guarded:
    """A zip file's bytes for `zipfile`, which would read a list of files of any length at once."""

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self._path = path
        self._file = file
        self.seek, self.tell, self.close = file.seek, file.tell, lambda: None
        self.seekable, self.readable = file.seekable, file.readable

    def read(self, size: int = -1) -> bytes:
        """Read so many bytes.

        Raises:
            LogError: They are more than any list of files should have.
        """
        data = self._file.read(min(size, MOST_LIST_BYTES + 1) if size >= 0 else MOST_LIST_BYTES + 1)
        if len(data) > MOST_LIST_BYTES:
            raise LogError(
                f"{self._path}: refused: expected a list of files of at most "
                f"{MOST_LIST_BYTES:,} bytes, got more."
            )
        return data
