"""The Prolog module that comes with this package, copied to where Prolog finds it."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from semmap_log.core.io.disk import copy_file

NAME = "semmap_log.pl"


def write_prolog_module(folder: Path) -> tuple[Path, bool]:
    """Copy the module, whole or not at all.

    Args:
        folder: Of a Prolog program; made if it is not there.

    Returns:
        Where it is, and whether it was written now: the same file is left as it is.

    Raises:
        OutputError: Another file bears its name there, or it cannot be written.
    """
    module = (files("semmap_log") / "live" / "planners" / "prolog" / NAME).read_bytes()
    target = folder / NAME
    return target, copy_file(module, target, kind="module")
