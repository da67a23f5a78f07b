"""The Prolog module that comes with this package, copied to where Prolog finds it."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from semmap_log.errors import OutputError
from semmap_log.io.disk import output_errors, replace_file

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
    module = (files("semmap_log") / "planners" / "prolog" / NAME).read_bytes()
    target = folder / NAME
    with output_errors(target):
        folder.mkdir(parents=True, exist_ok=True)
        if target.exists():
            if target.read_bytes() != module:
                raise OutputError(
                    f"{target}: is there already, and is not this module as it is now. Remove it "
                    "first, if nobody needs it."
                )
            return target, False
        replace_file(target, module)
    return target, True
