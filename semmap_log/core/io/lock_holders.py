"""Who holds a lock, as Linux lists it: a process that may write there, or a stranger.

Whoever may read a file or a folder may lock it (flock, and read locks of fcntl). So a lock on a
file that everybody can read shows a writer only if its holder may write there, too.
"""

from __future__ import annotations

import os
from pathlib import Path

_PROC = Path("/proc")
_MAY_WRITE_GROUP, _MAY_WRITE_OTHERS = 0o020, 0o002


def is_held_by_strangers(fd: int, folder: int) -> bool | None:
    """Return whether nobody who has locked a file (flock) may write in a folder.

    Args:
        fd: The file, or the folder itself, open.
        folder: The folder, open.

    Returns:
        None where this is not known: there is no /proc, the holder has ended and left the lock to
        a child, or it is out of sight, as from within a container.
    """
    status = os.fstat(folder)
    may_write = [_may_write(pid, status) for pid in _holders(os.fstat(fd))]
    if True in may_write:
        return False
    return None if not may_write or None in may_write else True


def _holders(file: os.stat_result) -> list[int]:
    """Return the processes that hold a lock (flock) on a file, as far as they can be seen."""
    place = f"{os.major(file.st_dev):02x}:{os.minor(file.st_dev):02x}:{file.st_ino}"
    try:
        lines = (_PROC / "locks").read_text("ascii", "replace").splitlines()
    except OSError:
        return []
    found = [line.split()[1:6] for line in lines]  # FLOCK ADVISORY WRITE PID PLACE
    return [int(one[3]) for one in found if one[0] == "FLOCK" and one[4] == place]


def _may_write(pid: int, folder: os.stat_result) -> bool | None:
    """Return whether a process may write in a folder; None: that cannot be found out.

    Its real ids count: a setuid program that a stranger has started holds what they locked.
    """
    try:
        lines = (_PROC / str(pid) / "status").read_text("utf-8", "replace").splitlines()
    except OSError:
        return None
    said = {name: values.split() for name, _, values in (line.partition(":") for line in lines)}
    uid, gids = int(said["Uid"][0]), {said["Gid"][0], *said["Groups"]}
    return (
        uid in (0, os.geteuid(), folder.st_uid)
        or bool(folder.st_mode & _MAY_WRITE_GROUP and str(folder.st_gid) in gids)
        or bool(folder.st_mode & _MAY_WRITE_OTHERS)
    )
