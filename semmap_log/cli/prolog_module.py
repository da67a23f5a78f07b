"""`prolog-module`: the module by which SWI-Prolog asks about doors, into a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from semmap_log.cli.common import AsJson, print_json, say
from semmap_log.core.texts import command_line


def run(
    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="The folder of a Prolog program; made if need be."),
    ],
    *,
    as_json: AsJson = False,
) -> None:
    """Copy the module semmap_log.pl for SWI-Prolog into a folder.

    With it a Prolog program asks about doors, and sets them: it talks to a server that
    `semmap-log serve LOG --ask ADDRESS` runs. What is there already under that name stays, and is
    an error unless it is the same.

    \b
    Examples:
      semmap-log prolog-module .
      swipl -g "use_module(semmap_log), door_server('unix:doors.sock')"
    """
    from semmap_log.live.planners.prolog.prolog_module import write_prolog_module

    module, is_new = write_prolog_module(folder)
    if as_json:
        print_json({"module": str(module), "written": is_new})
        return
    say(f"{module}: {'written' if is_new else 'there already, the same'}. To use it:")
    say(f"  {command_line('serve', 'LOG', '--ask', 'unix:doors.sock')}")
    say("  ?- use_module(semmap_log), door_server('unix:doors.sock').")
