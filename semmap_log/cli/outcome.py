"""What a command answers: the numbers of the events that it stored."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from semmap_log.cli.common import print_json

if TYPE_CHECKING:
    from semmap_log.door_log_writer import Appended


def tell(appended: Appended, *, as_json: bool, **more: Any) -> None:
    """Print which event a command became."""
    commit = appended.commit
    if as_json:
        print_json(
            {
                "event": commit.first_event,
                "count": commit.count,
                "repeated": appended.repeated,
                **more,
            }
        )
        return
    numbers = str(commit.first_event)
    if commit.count > 1:
        numbers += f"..{commit.last_event}"
    known = " (stored before; nothing was written now)" if appended.repeated else ""
    typer.echo(f"event {numbers}{known}")
