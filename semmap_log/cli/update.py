"""`update`: fields of a door are set."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli import door_options
from semmap_log.cli.common import AsJson, DoorName, WritableLog, check_not_nan, takes_about

if TYPE_CHECKING:
    from semmap_log.log import About


@takes_about
def run(
    log: WritableLog,
    door: DoorName,
    word: Annotated[
        str | None, typer.Argument(metavar="STATE", help="Its state, such as closed.")
    ] = None,
    *,
    x: door_options.X = None,
    y: door_options.Y = None,
    theta: door_options.Theta = None,
    width: door_options.Width = None,
    start: door_options.Start = None,
    end: door_options.End = None,
    level: Annotated[str | None, typer.Option(help="Level, by number or name.")] = None,
    state: door_options.StateOption = None,
    prob_open: Annotated[float | None, typer.Option(help="P(open), 0..1.")] = None,
    prob_closed: Annotated[float | None, typer.Option(help="P(closed), 0..1.")] = None,
    as_json: AsJson = False,
    about: About,
) -> None:
    """Set fields of a door; what is not given stays as it is.

    \b
    Examples:
      semmap-log update office front closed --actor ann --reason "lock up"
      semmap-log update office 3 --x 2.1 --y 1.5
      semmap-log update office 3 --prob-open 0.3 --prob-closed 0.7
    """
    from semmap_log.cli.door_options import tell
    from semmap_log.log import append

    state = door_options.state_given(word, state)
    check_not_nan(x=x, y=y, theta=theta, width=width, prob_open=prob_open, prob_closed=prob_closed)
    line = door_options.line_of(door_options.GivenLine(x, y, theta, width), start, end)
    fields = (line.x, line.y, line.theta, line.width, level, state, prob_open, prob_closed)
    if all(value is None for value in fields):
        raise typer.BadParameter("nothing to set: give at least one of the fields (--help)")
    with append(log) as opened, door_options.a_state_typed():
        appended = opened.update_door(
            door,
            x=line.x,
            y=line.y,
            theta=line.theta,
            width=line.width,
            level=level,
            state=state,
            prob_open=prob_open,
            prob_closed=prob_closed,
            **about,
        )
    tell(appended, as_json=as_json)
