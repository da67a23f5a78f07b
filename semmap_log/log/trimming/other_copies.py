"""Files that contain data of a log and are no part of it: in its folder, and copies next to it.

Copies are known by the log's identity in them.
"""

from __future__ import annotations

import os
import stat
import zipfile
import zlib
from collections.abc import Callable, Container, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

from semmap_log.core.io.disk import TEMPORARY_SUFFIX, open_plainly
from semmap_log.errors import LogError
from semmap_log.log.replay.read_model.events_about import FOLDER as INDEX_FOLDER
from semmap_log.log.replay.read_model.indexing import remove_stale_tables_alone
from semmap_log.log.replay.state import START_BYTES, log_id_of
from semmap_log.store import byte_layout
from semmap_log.store.folder import LogFolder, is_zip
from semmap_log.store.lock import WriterLock
from semmap_log.store.reading.segment_scan import MOST_HEADER_BYTES, head_in
from semmap_log.store.repairing.recovering import beside as recovery_folder

_NO_DATA = ("signatures", byte_layout.RECOVERING_NAME)
"""Files without contents of events: signed heads are hashes and numbers."""


class OtherFile(NamedTuple):
    """Something in a log's folder, or next to it, that may contain its data."""

    name: str
    kind: Literal[
        "index", "temporary", "torn", "damaged", "other", "recovering", "checkpoint", "copy"
    ]
    remove: Callable[[], None] | None = None
    """Removes it, where it can be made again, or is of no use."""


def other_files(log: Path) -> Iterator[OtherFile]:
    """Yield what is in a log's folder and is no part of the log as it stands.

    Args:
        log: Its folder.
    """
    for path in sorted(log.iterdir()):
        name = path.name
        if name == INDEX_FOLDER and path.is_dir():
            yield OtherFile(name, "index", partial(remove_stale_tables_alone, log))
        elif byte_layout.is_temporary(name):
            yield OtherFile(name, "temporary", path.unlink)
        elif byte_layout.TORN_SUFFIX in name:
            yield OtherFile(name, "torn")
        elif name.startswith("damaged-"):
            yield OtherFile(name, "damaged")
        elif not byte_layout.is_name_of_part(name) and name not in _NO_DATA:
            yield OtherFile(name, "other")


def copies_next_to(log: Path, log_ids: Container[str]) -> Iterator[OtherFile]:
    """Yield what is in the same folder as a log and is of it: copies, zips and checkpoints.

    What cannot be read is passed over.

    Args:
        log: Its folder.
        log_ids: Its identity, and those of the logs that it was recovered from.
    """
    folder = log.resolve()
    recovering = recovery_folder(folder)
    if recovering.exists():
        yield OtherFile(recovering.name, "recovering")
    for path in _entries(folder.parent):
        if path in (folder, recovering):
            continue
        if path.is_dir():
            if any(_id_of_segment(one) in log_ids for one in _segments_in(path)):
                yield OtherFile(path.name, "copy")
        elif log_id_of(_start_of(path, START_BYTES)) in log_ids:
            yield OtherFile(path.name, "checkpoint", path.unlink)
        elif (_id_of_segment(path) or _id_in_zip(path)) in log_ids:
            yield OtherFile(path.name, "copy")


def lock_log(log: Path) -> WriterLock:
    """Return the lock of a log's writer: until it is released, nobody writes.

    Raises:
        LogLockedError: Somebody is writing.
        LogAccessError: The file system denies access.
    """
    return WriterLock(LogFolder.held(log))


def holds_log(folder: Path, log_ids: Container[str]) -> bool:
    """Return whether there is a segment of one of these logs in a folder, however deep."""
    return any(_id_of_segment(path) in log_ids for path in folder.rglob("*.mcap"))


def _segments_in(folder: Path) -> list[Path]:
    """Return what may be segments in a folder, and in one that a killed `fetch` has left."""
    depth = "*/*.mcap" if folder.name.endswith(TEMPORARY_SUFFIX) else "*.mcap"
    try:
        return sorted(folder.glob(depth))
    except OSError:
        return []


def _entries(folder: Path) -> list[Path]:
    """Return what is in a folder, without links."""
    try:
        return sorted(path for path in folder.iterdir() if not path.is_symlink())
    except OSError:
        return []


def _id_of_segment(path: Path) -> str:
    """Return the id of the log that a file is a segment of; "": it is none."""
    is_one = path.suffix == ".mcap"
    return _id_in(path, _start_of(path, MOST_HEADER_BYTES)) if is_one else ""


def _id_in(path: Path, start: bytes) -> str:
    """Return the id of the log that the first bytes of a segment name; "": they are none."""
    with suppress(LogError):
        return head_in(path, memoryview(start))[0].info.log_id
    return ""


def _id_in_zip(path: Path) -> str:
    """Return the id of the log in a zip file."""
    if not is_zip(path):
        return ""
    try:
        with zipfile.ZipFile(path) as packed:
            names = [name for name in packed.namelist() if name.endswith(".mcap")]
            start = packed.open(names[0]).read(MOST_HEADER_BYTES) if names else b""
    except (zipfile.BadZipFile, zlib.error, EOFError, ValueError, RuntimeError, OSError):
        return ""  # damaged, encrypted, or packed in a way that is not known
    return _id_in(path, start)


def _start_of(path: Path, most: int) -> bytes:
    """Return the first bytes of a regular file; nothing, if it is none."""
    with suppress(OSError):
        fd = open_plainly(path)
        with os.fdopen(fd, "rb") as file:
            if stat.S_ISREG(os.fstat(fd).st_mode):
                return file.read(most)
    return b""
