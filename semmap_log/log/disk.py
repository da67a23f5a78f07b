"""Bytes to disk, so that they stay: whole writes, syncs, and files that appear whole or not at all.

A power cut leaves an unsynced file empty, and a rename that was not followed by a sync of its
folder undone; so does everything here.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from semmap_log.errors import OutputError
from semmap_log.log.form import TEMPORARY_SUFFIX


def write_all(fd: int, data: bytes | memoryview) -> None:
    """Write all of `data`; the kernel may take it in parts.

    Raises:
        OSError: As the kernel says; a part may have been written.
    """
    written = os.write(fd, data)
    if written == len(data):
        return
    view = memoryview(data)[written:]
    while view:
        view = view[os.write(fd, view) :]


def sync_file(path: Path) -> None:
    """Make what was written to a file, by whomever, survive a power cut."""
    fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def sync_folder(folder: Path) -> None:
    """Make the folder's entries (new names, renames) survive a power cut."""
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def refuse_own_folder(folder: Path, out: Path) -> None:
    """Keep what is made from a log out of the log's folder, where everything is the log's.

    Args:
        folder: The log's.
        out: The file or folder to be written.

    Raises:
        OutputError: It would lie there.
    """
    if folder.resolve() in (out.resolve(), out.parent.resolve()):
        raise OutputError(f"{out}: lies in the log's own folder; choose another place.")


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Hand out a temporary path beside `path`; on success it takes the name, synced, at once.

    On any error the temporary file is removed and `path` stays as it was.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}{TEMPORARY_SUFFIX}")
    try:
        yield temporary
        sync_file(temporary)
        _give_name(temporary, path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Hand out a path for a new folder of the same name; on success it takes its place, synced.

    It lies in a temporary folder beside `path`. On any error that is removed, with all in it.

    Raises:
        OutputError: There is something at `path` already: a folder is never replaced.
    """
    if path.exists():
        raise OutputError(f"{path}: is there already; remove it, or choose another name.")
    around = path.with_name(f".{path.name}.{os.getpid()}{TEMPORARY_SUFFIX}")
    shutil.rmtree(around, ignore_errors=True)  # of a process that was killed
    around.mkdir()
    temporary = around / path.name
    try:
        yield temporary
        for file in temporary.iterdir():
            sync_file(file)
        sync_folder(temporary)
        _give_name(temporary, path)
    finally:
        shutil.rmtree(around, ignore_errors=True)


def _give_name(temporary: Path, path: Path) -> None:
    os.replace(temporary, path)
    sync_folder(path.parent)


def replace_file(path: Path, data: bytes) -> None:
    """Put a file of these bytes in place of `path`, whole or not at all, synced."""
    with whole_file(path) as temporary, _new_file(temporary) as file:
        file.write(data)


def _new_file(path: Path) -> BinaryIO:
    try:
        return path.open("xb")
    except FileExistsError:  # of a process that was killed; or a stranger's link
        path.unlink()
        return path.open("xb")
