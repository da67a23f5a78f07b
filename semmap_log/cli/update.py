"""`update`: fields of a door are set; and a door's place as it is typed on the command line."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import AsJson, DoorName, WritableLog, refuse_nan, takes_about
from semmap_log.cli.observe import StateOption, a_state_typed, state_given
from semmap_log.cli.verb import POINT

if TYPE_CHECKING:
    from semmap_log.log.door_log.door_log_writer import About


X = Annotated[float | None, typer.Option(help="Start of the door's line, metres.")]
Y = Annotated[float | None, typer.Option(help="Start of the door's line, metres.")]
Theta = Annotated[float | None, typer.Option(help="Its direction, radians.")]
Width = Annotated[float | None, typer.Option(help="Its length, metres.")]
Start = Annotated[str | None, typer.Option("--from", metavar=POINT, help="Start of the line …")]
End = Annotated[str | None, typer.Option("--to", metavar=POINT, help="… and its end.")]


@dataclass(frozen=True, slots=True)
class Line:
    """A door's line; None: not given."""

    x: float | None
    y: float | None
    theta: float | None
    width: float | None


def line_of(line: Line, start: str | None, end: str | None) -> Line:
    """Return the line that either its own values or two points give.

    Raises:
        typer.BadParameter: Both, or only one of two points, or not points.
    """
    if start is None and end is None:
        return line
    if start is None or end is None or line != Line(None, None, None, None):
        raise typer.BadParameter("give --from and --to together, without --x --y --theta --width")
    (x0, y0), (x1, y1) = _point(start, "--from"), _point(end, "--to")
    return Line(x0, y0, math.atan2(y1 - y0, x1 - x0), round(math.hypot(x1 - x0, y1 - y0), 9))


def corners_of(text: str, option: str) -> list[tuple[float, float]]:
    """Return the points `X,Y` of a text with blanks between; of no text, none.

    Raises:
        typer.BadParameter: One is none.
    """
    return [_point(part, option) for part in text.split()]


def _point(text: str, option: str) -> tuple[float, float]:
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(
            f"expected X,Y in metres, got {text!r}", param_hint=option
        ) from None
    return x, y


@takes_about
def run(
    log: WritableLog,
    door: DoorName,
    word: Annotated[
        str | None, typer.Argument(metavar="STATE", help="Its state, such as closed.")
    ] = None,
    *,
    x: X = None,
    y: Y = None,
    theta: Theta = None,
    width: Width = None,
    start: Start = None,
    end: End = None,
    level: Annotated[str | None, typer.Option(help="Level, by number or name.")] = None,
    state: StateOption = None,
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
    import semmap_log as sl
    from semmap_log.cli.annotate import tell

    state = state_given(word, state)
    refuse_nan(x=x, y=y, theta=theta, width=width, prob_open=prob_open, prob_closed=prob_closed)
    line = line_of(Line(x, y, theta, width), start, end)
    fields = (line.x, line.y, line.theta, line.width, level, state, prob_open, prob_closed)
    if all(value is None for value in fields):
        raise typer.BadParameter("nothing to set: give at least one of the fields (--help)")
    with sl.append(log) as opened, a_state_typed():
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
