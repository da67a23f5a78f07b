"""A log put in the place of another, at once: readers see the old one or the new one.

    .office.recovering/     the new log is made here, beside `office`, marked by `.recovering`
    exchange                the two folders swap their names in one step (renameat2)
    office/damaged-1/       the old folder goes there; what was not the log's comes back
    office/.recovering      removed last

Killed before the exchange, the log is as it was, and the next recovery removes the unfinished
folder. Killed after it, the log is the new one, and the next recovery does the last two steps.
"""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from semmap_log.core.io.disk import TEMPORARY_SUFFIX, sync_folder
from semmap_log.core.texts import command_line
from semmap_log.errors import LogAccessError
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import (
    BAG_METADATA_NAME,
    LOCK_NAME,
    RECOVERING_NAME,
    TORN_SUFFIX,
    is_mark_name,
)

_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


def beside(log: Path) -> Path:
    """Return the folder in which the new log is made."""
    return log.with_name(f".{log.name}.recovering")


@contextmanager
def new_folder_beside(log: Path) -> Iterator[Path]:
    """Hand out an empty, marked folder beside a log's; it is removed if what follows fails."""
    folder = beside(log)
    if folder.is_symlink() or folder.exists():
        if folder.is_symlink() or not (folder / RECOVERING_NAME).exists():
            raise LogAccessError(f"{folder}: expected nothing at this place; move it elsewhere.")
        shutil.rmtree(folder)
    try:
        folder.mkdir(parents=True)
        (folder / RECOVERING_NAME).touch()
        yield folder
    except BaseException:
        if (folder / RECOVERING_NAME).exists():
            shutil.rmtree(folder, ignore_errors=True)
        raise


def take_place(log: Path, old: LogFolder) -> None:
    """Put the finished log beside `log` in its place, in one step.

    Args:
        log: Its path.
        old: What was read there, and is locked.

    Raises:
        LogAccessError: The file system cannot swap two folders; or another lies there now.
    """
    folder = beside(log)
    if not old.is_at(log):
        raise LogAccessError(f"{log}: was moved away while it was recovered; nothing is changed.")
    shutil.copymode(log, folder)
    sync_folder(folder)
    try:
        _exchange(folder, log)
    except OSError as error:
        raise LogAccessError(
            f"{log}: cannot be swapped with a new folder here: {error.strerror}. "
            f"Recover into another place: {command_line('recover', log, '--out', 'NEW', '--yes')}"
        ) from error
    sync_folder(log.parent)


def put_away(log: Path) -> Path | None:
    """Do what is left of a recovery whose new log is in its place; return where the old one is."""
    if not (log / RECOVERING_NAME).exists():
        return None
    old, kept = beside(log), None
    if old.exists():
        kept = _free_name(log)
        old.rename(kept)
        sync_folder(log)
        sync_folder(log.parent)
    for last in _last_kept(log):
        for path in sorted(last.iterdir()):
            if not _is_of_log(path) and not (log / path.name).exists():
                path.rename(log / path.name)
    (log / RECOVERING_NAME).unlink()
    sync_folder(log)
    return kept


def _last_kept(log: Path) -> list[Path]:
    """Return the folder of the last recovery, whose strangers may still have to come back."""
    kept = [path for path in log.glob("damaged-*") if path.is_dir() and not path.is_symlink()]
    return sorted(kept, key=_number)[-1:]


def _free_name(log: Path) -> Path:
    """Return the name behind those of all recoveries before."""
    used = [*log.glob("damaged-*"), *beside(log).glob("damaged-*")]
    return log / f"damaged-{1 + max(map(_number, used), default=0)}"


def _number(path: Path) -> int:
    digits = path.name.rpartition("-")[2]
    return int(digits) if digits.isascii() and digits.isdigit() else 0


def _is_of_log(path: Path) -> bool:
    """Tell whether a file is the damaged log's own."""
    name = path.name
    return (
        path.suffix == ".mcap"
        or TORN_SUFFIX in name
        or name in (BAG_METADATA_NAME, LOCK_NAME)
        or is_mark_name(name)
        or name.endswith(TEMPORARY_SUFFIX)
    )


def _exchange(one: Path, other: Path) -> None:
    """Swap the names of two folders, in one step."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except AttributeError:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS)) from None
    names = os.fsencode(one), os.fsencode(other)
    if rename(_AT_FDCWD, names[0], _AT_FDCWD, names[1], _RENAME_EXCHANGE):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
