"""A state as typed on the command line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

import typer

from semmap_log.errors import InvalidEventError

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
    """Take a state that there is not, of which the log tells with its classes, for a wrong option.

    Raises:
        typer.BadParameter: Instead of the error that the log has.
    """
    try:
        yield
    except InvalidEventError as error:
        if error.where != "state":
            raise
        raise typer.BadParameter(str(error).partition(": ")[2], param_hint="STATE") from None
