"""`oprs-package`: the module that OpenPRS kernels load, to build it."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from semmap_log.cli.common import AsJson, print_json, say
from semmap_log.core.texts import command_line


def run(
    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="It must be there; the module gets a folder in it."),
    ],
    *,
    as_json: AsJson = False,
) -> None:
    """Copy the module for OpenPRS kernels, to build it there.

    It is a module in C, with a Makefile, that gives a kernel the thesis's predicates, functions
    and actions: they ask and change the doors of a running `semmap-log serve LOG --ask`. Next to it
    is an include file, and plans by which the actions are goals. What is there already under that
    name stays, and is an error unless it is the same.

    \b
    Examples:
      semmap-log oprs-package ~/robot
      make -C ~/robot/semantic_map_oprs OPRS=~/OpenPRS
    """
    from semmap_log.live.oprs.oprs_package import write_oprs_package

    package, is_new = write_oprs_package(folder)
    if as_json:
        print_json({"package": str(package), "written": is_new})
        return
    path = shlex.quote(str(package.absolute()))
    say(f"{package}: {'written' if is_new else 'there already, the same'}. To build it:")
    say(f"  make -C {path} OPRS=FOLDER    the one in which OpenPRS was built")
    served = command_line("serve", "LOG", "--ask", "ADDRESS")
    say(f"Then, with SEMMAP_ASK set to the address of `{served}`, a kernel by itself:")
    say(f"  oprs -a -A -n K1 -l none -x {path}/semantic_map.inc")
