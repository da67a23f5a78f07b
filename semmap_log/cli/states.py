"""A state as typed on the command line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import typer

from semmap_log.errors import InvalidEventError


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
