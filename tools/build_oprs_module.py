"""Build the module for OpenPRS kernels, against an OpenPRS that is built already.

    SEMMAP_OPRS=/path/to/OpenPRS python tools/build_oprs_module.py DIR

makes DIR/semantic_map_oprs with the module and its include file in it: as `semmap-log
oprs-package DIR` and `make` do, and it says what is missing of OpenPRS. The tests that need a real
kernel build theirs by this, and are skipped where SEMMAP_OPRS is not set.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from semmap_log.errors import SemmapError
from semmap_log.live.oprs.oprs_package import write_oprs_package

VARIABLE = "SEMMAP_OPRS"
KERNEL = "src/oprs"
HEADERS = "src/oprs-type_f-pub.h"


class NoOprsError(Exception):
    """There is no OpenPRS to build against: what is missing."""


def find_oprs() -> Path:
    """Return the folder in which OpenPRS was built.

    Raises:
        NoOprsError: The environment names none, or it is not built.
    """
    named = os.environ.get(VARIABLE)
    if not named:
        raise NoOprsError(f"{VARIABLE} is not set: it names the folder in which OpenPRS was built")
    folder = Path(named).absolute()
    for needed in (KERNEL, HEADERS):
        if not (folder / needed).is_file():
            raise NoOprsError(f"{VARIABLE}={named}: has no {needed}")
    return folder


def build_module(oprs: Path, folder: Path, *options: str) -> Path:
    """Build the module in a folder of its own in `folder`; warnings are errors.

    Returns:
        Its include file, for `oprs -x`.

    Raises:
        NoOprsError: It cannot be built; what the compiler said.
    """
    package, _ = write_oprs_package(folder)
    make = ["make", "-C", str(package), f"OPRS={oprs}", "CFLAGS=-O2 -g -Wall -Wextra -Werror"]
    done = subprocess.run([*make, *options], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise NoOprsError(f"{' '.join(make)}:\n{done.stdout}{done.stderr}")
    return package / "semantic_map.inc"


def main(arguments: Sequence[str] | None = None) -> int:
    """Build; 0 it is there, 1 it is not."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", metavar="DIR", type=Path, help="it must be there")
    chosen = parser.parse_args(arguments)
    try:
        oprs = find_oprs()
        include = build_module(oprs, chosen.folder)
    except (NoOprsError, SemmapError) as error:
        print(f"build_oprs_module: {error}", file=sys.stderr)
        return 1
    print(f"{oprs / KERNEL} -a -A -n K1 -l none -x {include}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
