"""Files that come with this package, copied to where somebody uses them.

What is there already stays: plans and launch files are there to be changed.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from fnmatch import fnmatch
from pathlib import Path

from semmap_log.core.io.disk import output_errors, replace_file, whole_folder
from semmap_log.errors import OutputError


def copy_folder(
    shipped: Path,
    target: Path,
    *,
    kind: str,
    made: Sequence[str],
    finish: Callable[[Path], object] = lambda _: None,
) -> bool:
    """Copy a folder, whole or not at all.

    Args:
        shipped: What is copied.
        target: Where to; it is made.
        kind: What it is called where another is there: a `package`.
        made: Names with wildcards: what installers and compilers put into it is no part of it.
        finish: What is done to the copy before it is there.

    Returns:
        Whether it was written now: the same is left as it is.

    Raises:
        OutputError: Something else bears its name there, or it cannot be written.
    """
    if target.exists():
        if differing := _differing(shipped, target, made):
            raise _is_another(target, kind, f" ({differing} differs)")
        return False
    with output_errors(target), whole_folder(target) as temporary:
        shutil.copytree(shipped, temporary, ignore=shutil.ignore_patterns(*made))
        finish(temporary)
    return True


def copy_file(shipped: bytes, target: Path, *, kind: str) -> bool:
    """Copy a file, whole or not at all; its folder is made if it is not there.

    Args:
        shipped: What is in it.
        target: Where to.
        kind: What it is called where another is there: a `module`.

    Returns:
        Whether it was written now: the same is left as it is.

    Raises:
        OutputError: Another bears its name there, or it cannot be written.
    """
    with output_errors(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.exists():
            if target.read_bytes() != shipped:
                raise _is_another(target, kind)
            return False
        replace_file(target, shipped)
    return True


def _is_another(target: Path, kind: str, differing: str = "") -> OutputError:
    return OutputError(
        f"{target}: is there already, and is not this {kind} as it is now{differing}. "
        "Remove it first, if nobody needs it."
    )


def _differing(shipped: Path, target: Path, made: Sequence[str]) -> str:
    """Return a file that another folder has not, or not alike; "": there is none."""
    for path in sorted(shipped.rglob("*")):
        name = path.relative_to(shipped)
        other = target / name
        if path.is_dir() or any(fnmatch(part, each) for part in name.parts for each in made):
            continue
        if not (other.is_file() and other.read_bytes() == path.read_bytes()):
            return str(name)
    return ""
