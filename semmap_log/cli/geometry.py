"""Where a door lies, as given on the command line."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import typer

from semmap_log.cli.verb import POINT

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
