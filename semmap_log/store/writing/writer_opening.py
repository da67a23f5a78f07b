"""How a writer opens a log: creates it, or continues where it ended."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Generic

from semmap_log.core.io.disk import check_can_write, sync_folder
from semmap_log.core.io.virtual_logs import check_not_virtual
from semmap_log.core.texts import command_line
from semmap_log.errors import LogAccessError, LogError, LogExistsError
from semmap_log.store.byte_layout import NO_HASH, has_name_of_file
from semmap_log.store.compaction.merge import MergedFiles
from semmap_log.store.folder import LogFolder
from semmap_log.store.header import LogInfo, SegmentHeader
from semmap_log.store.lock import WriterLock
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_folder import check_is_log
from semmap_log.store.writing.keyframe_source import K_co, NewKeyframeSource
from semmap_log.store.writing.writer import Environment, LogWriter


@dataclass(frozen=True, slots=True)
class OpenedLog(Generic[K_co]):
    """A log that was opened for writing, and what was read for that, so that it is read once."""

    writer: LogWriter
    reader: LogReader
    """The log as the writer continues it."""
    keyframes: K_co
    """Where its keyframes come from."""


def create_log(
    path: Path,
    info: LogInfo,
    new_keyframes: NewKeyframeSource[K_co],
    environment: Environment = Environment(),
) -> OpenedLog[K_co]:
    """Make a new log in a folder that does not exist, or is empty, and open it.

    Args:
        path: The folder.
        info: What is fixed of the log.
        new_keyframes: Makes the source of its keyframes.
        environment: What the writer takes from the machine.

    Raises:
        LogExistsError: Something is there already.
        LogError: Its name is that of a file: a zip of a log, or a segment.
        LogAccessError: The folder cannot be made, or this system lacks what writing needs.
    """
    check_can_write(path)
    with _as_access_error(path, "no log can be made here"):
        _check_is_free(path)
        _check_is_folders_name(path)
        path.mkdir(parents=True, exist_ok=True)
        folder = LogFolder.held(path)
        with _locked(folder) as lock:
            _check_is_free(path, folder)  # again: somebody may have been quicker
            folder.remove_stale_files()
            writer = LogWriter(folder, lock, environment)
            keyframes = new_keyframes(folder, writer.flush)
            header = SegmentHeader(info, number=0, first_event=0, hash_so_far=NO_HASH)
            writer.begin(header, keyframes)
            sync_folder(path.parent)
            with _closed_on_error(writer):
                return OpenedLog(writer, LogReader(folder), keyframes)


def open_for_append(
    path: Path,
    new_keyframes: NewKeyframeSource[K_co],
    environment: Environment = Environment(),
) -> OpenedLog[K_co]:
    """Open a log for writing; a last segment that a crash left torn is made whole first.

    Args:
        path: Its folder.
        new_keyframes: Makes the source of its keyframes.
        environment: What the writer takes from the machine.

    Raises:
        NotALogError: There is no log.
        LogLockedError: Another writer has it.
        LogAccessError: The file system does not let us.
        CorruptLogError: Commits that were acknowledged are damaged.
    """
    check_not_virtual(path)
    check_is_log(LogFolder(path))  # before a lock file is put into somebody else's folder
    with _as_access_error(path, "cannot be opened"), _held(path) as (folder, lock):
        folder.remove_stale_files()
        return _taken_up(folder, lock, new_keyframes, environment)


def _taken_up(
    folder: LogFolder,
    lock: WriterLock,
    new_keyframes: NewKeyframeSource[K_co],
    environment: Environment,
) -> OpenedLog[K_co]:
    reader = LogReader(folder)
    MergedFiles.of(reader.segments, reader.leftovers).remove(folder)
    writer = LogWriter(folder, lock, environment)
    keyframes = new_keyframes(folder, writer.flush, reader)
    writer.proceed(reader, keyframes)
    if _may_be_half_made(reader):
        sync_folder(folder.path.parent)
    with _closed_on_error(writer):
        reader.refresh()  # a torn segment was made whole, in another file
        return OpenedLog(writer, reader, keyframes)


@contextmanager
def _closed_on_error(writer: LogWriter) -> Iterator[None]:
    """Close a writer if opening fails, since no caller could."""
    try:
        yield
    except BaseException:
        with suppress(LogError):
            writer.close()
        raise


def _check_is_free(path: Path, folder: LogFolder | None = None) -> None:
    if path.exists() and not (path.is_dir() and (folder or LogFolder(path)).is_empty()):
        raise LogExistsError(
            f"{path}: expected a new or empty folder for the log, but this one has files."
        )


def _check_is_folders_name(path: Path) -> None:
    if has_name_of_file(path):
        line = command_line("init", path.with_suffix(""))
        raise LogError(
            f"{path}: a log is a folder, and this is the name of a file; leave {path.suffix} out: "
            f"{line}"
        )
    if path.name == "-":
        raise LogError(f"{path}: expected the name of a folder; a log is not written to a stream.")


def _may_be_half_made(reader: LogReader) -> bool:
    """Return whether the log's creator may have been killed before the folder's name was synced."""
    return len(reader.segments) == 1 and not reader.segments[0].closed


@contextmanager
def _held(path: Path) -> Iterator[tuple[LogFolder, WriterLock]]:
    folder = LogFolder.held(path)
    with _locked(folder) as lock:
        yield folder, lock


@contextmanager
def _locked(folder: LogFolder) -> Iterator[WriterLock]:
    """Take the lock; let it go again if what follows fails."""
    lock = WriterLock(folder)
    try:
        yield lock
    except BaseException:
        lock.release()
        raise


@contextmanager
def _as_access_error(path: Path, problem: str) -> Iterator[None]:
    try:
        yield
    except LogAccessError:
        raise
    except OSError as error:
        raise LogAccessError(f"{path}: {problem}: {error.strerror}.") from error
