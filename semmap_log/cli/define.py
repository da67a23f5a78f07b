"""`define`: a class of objects that are no doors."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import AsJson, WritableLog, takes_about

if TYPE_CHECKING:
    from semmap_log.log import About


class GeometryChoice(str, Enum):
    """`semmap_log.core.model.doors.Geometry`, as typer wants its choices."""

    segment = "segment"
    polygon = "polygon"
    point = "point"


@takes_about
def run(
    log: WritableLog,
    name: Annotated[str, typer.Argument(metavar="CLASS", help="What it is called, such as dock.")],
    *,
    geometry: Annotated[
        GeometryChoice, typer.Option(help="What an object of it covers of the floor.")
    ] = GeometryChoice.segment,
    states: Annotated[
        str, typer.Option(metavar="A,B[,C]", help="Its words for OPEN, CLOSED and MOVING.")
    ] = "OPEN,CLOSED,MOVING",
    blocks: Annotated[
        str | None,
        typer.Option(metavar="WORDS", help="In which of them it blocks a robot; default: CLOSED."),
    ] = None,
    as_json: AsJson = False,
    about: About,
) -> None:
    """Define a class of objects that are no doors: lifts, docks, gates, spill zones.

    Its objects have the life of a door: they are added (`add --class`), seen, set, moved, removed
    and believed to be in a state. --blocks "" is for what never blocks. A class that is defined
    again is another one from then on. `info` shows the classes of a log.

    \b
    Examples:
      semmap-log define hub dock --geometry point --states free,taken --blocks ""
      semmap-log define hub shutter --geometry segment
      semmap-log define hub spill --geometry polygon --states dry,wet --blocks wet
      semmap-log add office --class spill --name foyer --outline "2,1 4,1 4,3 2,3"
    """
    from semmap_log.cli.door_options import tell
    from semmap_log.log import append

    with append(log) as opened:
        appended = opened.define_class(
            name,
            geometry=geometry.value,
            states=states,
            blocks=blocks,
            **about,
        )
    tell(appended, as_json=as_json)
