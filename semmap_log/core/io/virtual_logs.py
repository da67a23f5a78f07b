"""Logs that are made of others when they are opened: a file's suffix, and who makes them.

The maker knows the log; the opener does not. So the upper package registers its maker here.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path, PurePath
from typing import Protocol

from semmap_log.core.texts import command_line
from semmap_log.errors import LogAccessError


class VirtualLog(Protocol):
    """The files of a log that was made; they stay at least as long as this is held."""

    path: Path
    """Their folder."""


_makers: dict[str, Callable[[Path], VirtualLog]] = {}


def register_maker(suffix: str, make: Callable[[Path], VirtualLog]) -> None:
    """Let files with a suffix be opened as the logs that are made of them.

    Args:
        suffix: Such as `.join.json`.
        make: Returns the log of a file; raises `LogError` where it cannot be made.
    """
    _makers[suffix] = make


def has_virtual_suffix(path: PurePath) -> bool:
    """Return whether a path has the name of a definition of such a log."""
    return path.name.lower().endswith(tuple(_makers)) if _makers else False


def virtual_log(path: Path) -> VirtualLog | None:
    """Return the log that is made of a file; None: the path is another thing.

    Raises:
        LogError: It cannot be made.
    """
    if not has_virtual_suffix(path) or not path.is_file():
        return None
    suffix = next(each for each in _makers if path.name.lower().endswith(each))
    return _makers[suffix](path)


def check_not_virtual(path: Path) -> None:
    """Keep whoever wants to write from a log that is made of others.

    Raises:
        LogAccessError: It is one.
    """
    if has_virtual_suffix(path) and path.is_file():
        line = command_line("join", path, "--write", "NEW")
        raise LogAccessError(
            f"{path}: a join of logs can only be read. Write to one of its logs, or make a log of "
            f"its own of it: {line}"
        )
