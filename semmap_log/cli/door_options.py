"""How doors are typed on a command line, and what a verb that writes prints."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import print_json
from semmap_log.cli.verb import POINT
from semmap_log.errors import InvalidEventError

if TYPE_CHECKING:
    from semmap_log.log import Appended


StateOption = Annotated[
    str | None,
    typer.Option("--state", metavar="STATE", help="OPEN, CLOSED, UNKNOWN, MOVING or OFFLINE."),
]


def state_given(word: str | None, option: str | None) -> str | None:
    """Return the state that is typed as a word, or by `--state`.

    Raises:
        typer.BadParameter: It is given twice.
    """
    if word is not None and option is not None:
        raise typer.BadParameter(f"is given already: {word}", param_hint="--state")
    return word if option is None else option


@contextmanager
def a_state_typed() -> Iterator[None]:
    """Treat an unknown state, for which the log lists those of its classes, as a wrong option.

    Raises:
        typer.BadParameter: Instead of the error that the log has.
    """
    try:
        yield
    except InvalidEventError as error:
        if error.where != "state":
            raise
        raise typer.BadParameter(str(error).partition(": ")[2], param_hint="STATE") from None


X = Annotated[float | None, typer.Option(help="Start of the door's line, metres.")]


Y = Annotated[float | None, typer.Option(help="Start of the door's line, metres.")]


Theta = Annotated[float | None, typer.Option(help="Its direction, radians.")]


Width = Annotated[float | None, typer.Option(help="Its length, metres.")]


Start = Annotated[str | None, typer.Option("--from", metavar=POINT, help="Start of the line …")]


End = Annotated[str | None, typer.Option("--to", metavar=POINT, help="… and its end.")]


@dataclass(frozen=True, slots=True)
class GivenLine:
    """A door's line; None: not given."""

    x: float | None
    y: float | None
    theta: float | None
    width: float | None


def line_of(line: GivenLine, start: str | None, end: str | None) -> GivenLine:
    """Return the line that either its own values or two points give.

    Raises:
        typer.BadParameter: Both, or only one of two points, or not points.
    """
    if start is None and end is None:
        return line
    if start is None or end is None or line != GivenLine(None, None, None, None):
        raise typer.BadParameter("give --from and --to together, without --x --y --theta --width")
    (x0, y0), (x1, y1) = _point(start, "--from"), _point(end, "--to")
    return GivenLine(x0, y0, math.atan2(y1 - y0, x1 - x0), round(math.hypot(x1 - x0, y1 - y0), 9))


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


def tell(appended: Appended, *, as_json: bool, **more: Any) -> None:
    """Print which event a command became."""
    first, count = appended.first_event, appended.count
    if as_json:
        print_json({"event": first, "count": count, "repeated": appended.repeated, **more})
        return
    numbers = str(first) if count == 1 else f"{first}..{first + count - 1}"
    known = " (stored before; nothing was written now)" if appended.repeated else ""
    typer.echo(f"event {numbers}{known}")
