"""The module for OpenPRS that comes with this package, copied to where it is built."""

from __future__ import annotations

import shutil
from importlib.resources import as_file, files
from pathlib import Path

from semmap_log.errors import OutputError
from semmap_log.io.disk import whole_folder

NAME = "semantic_map_oprs"
MADE = ("__pycache__", "*.o", "*.so", "semantic_map.inc")
"""What installers and `make` put beside the sources."""


def write_oprs_package(folder: Path) -> tuple[Path, bool]:
    """Copy the module's sources and plans, whole or not at all.

    Args:
        folder: In which they go, in a folder of their own; it must be there.

    Returns:
        Where they are, and whether they were written now: the same files are left as they are.

    Raises:
        OutputError: There is no such folder, or something else bears the module's name in it.
    """
    target = folder / NAME
    if not folder.is_dir():
        raise OutputError(f"{folder}: no such folder; expected one to put {NAME} in.")
    with as_file(files("semmap_log") / "oprs" / NAME) as package:
        if target.exists():
            if differing := _differing(package, target):
                raise OutputError(
                    f"{target}: is there already, and is not this module as it is now "
                    f"({differing} differs). Remove it first, if nobody needs it."
                )
            return target, False
        with whole_folder(target) as temporary:
            shutil.copytree(package, temporary, ignore=shutil.ignore_patterns(*MADE))
    return target, True


def _differing(package: Path, target: Path) -> str:
    """Return a file of the package that another folder has not, or not alike; "": there is none."""
    for path in sorted(package.rglob("*")):
        name = path.relative_to(package)
        other = target / name
        if path.is_dir() or any(path.match(made) for made in MADE):
            continue
        if not (other.is_file() and other.read_bytes() == path.read_bytes()):
            return str(name)
    return ""
