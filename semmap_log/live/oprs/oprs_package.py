"""The module for OpenPRS that comes with this package, copied to where it is built."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path

from semmap_log.core.io.disk import copy_folder
from semmap_log.errors import OutputError

NAME = "semantic_map_oprs"
MADE = ("__pycache__", "*.o", "*.so", "semantic_map.inc")
"""What installers and `make` put next to the sources."""


def write_oprs_package(folder: Path) -> tuple[Path, bool]:
    """Copy the module's sources and plans, whole or not at all.

    Args:
        folder: In which they go, in a folder of their own; it must be there.

    Returns:
        Where they are, and whether they were written now: the same files are left as they are.

    Raises:
        OutputError: There is no such folder, something else bears the module's name in it, or it
            cannot be written.
    """
    target = folder / NAME
    if not folder.is_dir():
        raise OutputError(f"{folder}: no such folder; expected one to put {NAME} in.")
    with as_file(files("semmap_log") / "live" / "oprs" / NAME) as package:
        return target, copy_folder(package, target, kind="module", made=MADE)
