"""Which files and folders next to a log are copies of it, by the log's identity in them."""

from __future__ import annotations

import os
import stat
import zipfile
import zlib
from collections.abc import Container, Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from semmap_log.core.io.disk import TEMPORARY_SUFFIX, open_plainly
from semmap_log.errors import LogError
from semmap_log.log.replay.state import START_BYTES, log_id_of
from semmap_log.store.folder import is_zip
from semmap_log.store.reading.segment_scan import MOST_HEADER_BYTES, head_in


class SameLog(NamedTuple):
    """A file or folder next to a log that contains its data."""

    name: str
    is_checkpoint: bool


def beside(log: Path, log_ids: Container[str]) -> Iterator[SameLog]:
    """Yield what lies in the same folder as a log and is of it: copies, zips and checkpoints.

    What cannot be read is passed over.

    Args:
        log: Its folder.
        log_ids: Its identity, and those of the logs that it was recovered from.
    """
    folder = log.resolve()
    for path in _entries(folder.parent):
        if path == folder:
            continue
        if path.is_dir():
            if any(_id_of_segment(one) in log_ids for one in _segments_in(path)):
                yield SameLog(path.name, is_checkpoint=False)
        elif log_id_of(_start_of(path, START_BYTES)) in log_ids:
            yield SameLog(path.name, is_checkpoint=True)
        elif (_id_of_segment(path) or _id_in_zip(path)) in log_ids:
            yield SameLog(path.name, is_checkpoint=False)


def holds(folder: Path, log_ids: Container[str]) -> bool:
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
