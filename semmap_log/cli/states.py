"""A door's state as typed on the command line."""

from __future__ import annotations

import typer

from semmap_log.domain.doors import DoorState


def state_of(text: str) -> DoorState:
    """Return the state of that name.

    Raises:
        typer.BadParameter: None of the five names.
    """
    try:
        return DoorState.parse(text)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="STATE") from None
