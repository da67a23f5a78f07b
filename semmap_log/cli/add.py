"""`add`: a door comes into the map."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import AsJson, WritableLog, check_not_nan, print_json, say, takes_about
from semmap_log.cli.door_options import (
    End,
    GivenLine,
    Start,
    Theta,
    Width,
    X,
    Y,
    corners_of,
    line_of,
)

if TYPE_CHECKING:
    from semmap_log.log import About


@takes_about
def run(
    log: WritableLog,
    *,
    x: X = None,
    y: Y = None,
    theta: Theta = None,
    width: Width = None,
    start: Start = None,
    end: End = None,
    level: Annotated[
        str | None, typer.Option(help="Level, by number or name; needed if there are several.")
    ] = None,
    name: Annotated[str, typer.Option(help="What people call it.")] = "",
    state: Annotated[
        str, typer.Option(help="OPEN, CLOSED, UNKNOWN, MOVING or OFFLINE; or its class's word.")
    ] = "UNKNOWN",
    prob_open: Annotated[float | None, typer.Option(help="P(open), 0..1.")] = None,
    prob_closed: Annotated[float | None, typer.Option(help="P(closed), 0..1.")] = None,
    door_id: Annotated[
        int | None, typer.Option("--id", help="Its id; default: the next free one.")
    ] = None,
    object_class: Annotated[
        str, typer.Option("--class", metavar="CLASS", help="What it is, if no door: see `define`.")
    ] = "",
    outline: Annotated[
        str, typer.Option(metavar='"X,Y X,Y …"', help="Corners of a polygon, metres, frame map.")
    ] = "",
    as_json: AsJson = False,
    about: About,
) -> None:
    """Add a door, or another object; prints its id.

    Without a place it is an unplaced door: it has a history and is drawn nowhere. A point needs
    --x and --y, a polygon --outline.

    \b
    Examples:
      semmap-log add office --x 2 --y 1.5 --theta 0 --width 0.9 --name front
      semmap-log add office --from 2,1.5 --to 2.9,1.5 --state open --actor ann
      semmap-log add office --name "reed contact 7"
      semmap-log add office --class dock --x 4 --y 2 --state free
      semmap-log add office --class spill --outline "2,1 4,1 4,3" --state wet
    """
    from semmap_log.cli.door_options import a_state_typed
    from semmap_log.core.model.doors import DoorId, suspect_units
    from semmap_log.log import append

    check_not_nan(x=x, y=y, theta=theta, width=width, prob_open=prob_open, prob_closed=prob_closed)
    line = line_of(GivenLine(x, y, theta, width), start, end)
    place = (line.x, line.y, line.theta, line.width)
    is_half_given = any(v is None for v in place) and any(v is not None for v in place)
    if is_half_given and not object_class:
        raise typer.BadParameter("give --x --y --theta --width all together, or none of them")
    given = [math.nan if value is None else value for value in place]
    with append(log) as opened, a_state_typed():
        added = opened.add_door(
            x=given[0],
            y=given[1],
            theta=given[2],
            width=given[3],
            level=level,
            name=name,
            state=state,
            prob_open=math.nan if prob_open is None else prob_open,
            prob_closed=math.nan if prob_closed is None else prob_closed,
            door_id=None if door_id is None else DoorId(door_id),
            object_class=object_class,
            outline=corners_of(outline, "--outline"),
            **about,
        )
    for what in suspect_units(theta=given[2], width=given[3]):
        say(f"warning: {what}")
    if as_json:
        print_json({"door_id": added})
    else:
        typer.echo(added)
