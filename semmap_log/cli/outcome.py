"""What a command answers: the numbers of the events that it stored."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from semmap_log.cli.common import print_json

if TYPE_CHECKING:
    from semmap_log.log.door_log.appended import Appended


def tell(appended: Appended, *, as_json: bool, **more: Any) -> None:
    """Print which event a command became."""
    first, count = appended.first_event, appended.count
    if as_json:
        print_json({"event": first, "count": count, "repeated": appended.repeated, **more})
        return
    numbers = str(first) if count == 1 else f"{first}..{first + count - 1}"
    known = " (stored before; nothing was written now)" if appended.repeated else ""
    typer.echo(f"event {numbers}{known}")
