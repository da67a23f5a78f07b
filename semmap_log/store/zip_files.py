"""What is a zip file: a log in it can be read, not written."""

from __future__ import annotations

import stat
from pathlib import Path

from semmap_log.core.io.made_logs import refuse_made
from semmap_log.errors import LogAccessError

_MAGIC = (b"PK\3\4", b"PK\5\6")
"""Of a zip that holds something, and of one that holds nothing."""


def is_zip(path: Path) -> bool:
    """Tell whether a path leads to a zip file, by its first bytes."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            return False
        with path.open("rb") as file:
            return file.read(len(_MAGIC[0])) in _MAGIC
    except OSError:
        return False


def refuse_zip(path: Path) -> None:
    """Keep whoever wants to write from a zipped log, and from one that is made of others.

    Raises:
        LogAccessError: It is one.
    """
    refuse_made(path)
    if is_zip(path):
        import shlex

        raise LogAccessError(
            f"{path}: a log in a zip file can only be read. To write to it, unpack it first, "
            f"for example: unzip {shlex.quote(str(path))}"
        )
