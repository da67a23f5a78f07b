"""A program that runs as if it were on a system that lacks much of what Linux has.

    python -m tests.store.elsewhere windows|macos VERB ARGUMENT…

What such a system lacks is taken away before anything of ours is imported; then it is the command
line. It is no such system: paths, line ends and what a file's name may be stay those of this one.
"""

from __future__ import annotations

import ctypes
import errno
import mmap
import os
import select
import shutil
import signal
import subprocess  # noqa: F401 - what the standard library brings is not ours to test
import sys
import tempfile  # noqa: F401
from typing import Any

MACOS = {
    os: ("preadv", "pwritev", "posix_fadvise", "fdatasync", "sched_getaffinity"),
}
WINDOWS: dict[Any, tuple[str, ...]] = {
    os: (*MACOS[os], "O_NOFOLLOW", "O_DIRECTORY", "O_NONBLOCK", "O_CLOEXEC", "pread", "pwrite",
         "fork", "getuid", "geteuid", "link", "register_at_fork"),
    signal: ("SIGHUP", "SIGALRM", "SIGKILL"),
    select: ("poll", "epoll"),
    mmap: ("MAP_SHARED", "MAP_PRIVATE", "PROT_READ", "PROT_WRITE", "MADV_RANDOM", "MADV_WILLNEED",
           "MADV_DONTNEED"),
}  # fmt: skip
TAKES_NO_FOLDER = ("open", "stat", "unlink", "mkdir", "rmdir", "rename", "replace", "access")


def _take_away(system: str) -> None:
    for module, names in (MACOS if system == "macos" else WINDOWS).items():
        for name in names:
            if hasattr(module, name):
                delattr(module, name)
    if system == "macos":
        return
    for name in ("fcntl", "pwd", "grp", "resource", "termios", "tty"):
        sys.modules[name] = None  # type: ignore[assignment]
    os.supports_dir_fd = os.supports_fd = set()
    shutil._use_fd_functions = False  # type: ignore[attr-defined]  # as it would have found out
    for name in TAKES_NO_FOLDER:
        setattr(os, name, _without_folders(getattr(os, name)))
    os.scandir = _by_path(os.scandir)  # type: ignore[assignment]
    ctypes.CDLL = _no_library  # type: ignore[assignment, misc]


def _without_folders(call: Any) -> Any:
    def called(path: Any, *more: Any, **named: Any) -> Any:
        for name in ("dir_fd", "src_dir_fd", "dst_dir_fd"):
            if named.pop(name, None) is not None:
                raise NotImplementedError(f"{name} unavailable on this platform")
        if call is _OPEN and os.path.isdir(path):  # noqa: PTH112
            raise PermissionError(errno.EACCES, "Permission denied", path)
        return call(path, *more, **named)

    return called


def _by_path(call: Any) -> Any:
    def called(path: Any = ".") -> Any:
        if isinstance(path, int):
            raise TypeError("scandir: path should be string, not int")
        return call(path)

    return called


def _no_library(name: Any, *_: Any, **__: Any) -> Any:
    raise TypeError(f"LoadLibrary() argument 1 must be str, not {type(name).__name__}")


_OPEN = os.open

if __name__ == "__main__":
    _take_away(sys.argv[1])
    from semmap_log.cli import main

    main(sys.argv[2:])
