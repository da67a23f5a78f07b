"""`patrol`: a round begins or ends."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import AsJson, WritableLog, takes_about

if TYPE_CHECKING:
    from semmap_log.log import About


class Phase(str, Enum):
    """What the round does."""

    start = "start"
    finish = "finish"


@takes_about
def run(
    log: WritableLog,
    phase: Annotated[
        Phase, typer.Argument(metavar="start|finish", help="What the round does now.")
    ],
    name: Annotated[str, typer.Argument(metavar="NAME", help="The round's name.")] = "",
    *,
    as_json: AsJson = False,
    about: About,
) -> None:
    """Mark the start or the end of a patrol round; rounds are numbered from 1 on.

    \b
    Examples:
      semmap-log patrol office start "evening round" --actor tug1
      semmap-log patrol office finish
    """
    from semmap_log.cli.door_options import tell
    from semmap_log.log import append

    if name:
        about["reason"] = f"{name}: {about['reason']}" if about["reason"] else name
    with append(log) as opened:
        if phase is Phase.start:
            appended, number = opened.start_patrol(**about)
        else:
            appended, number = opened.finish_patrol(**about)
    tell(appended, as_json=as_json, patrol=number)
