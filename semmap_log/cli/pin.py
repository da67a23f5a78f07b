"""`pin`: a moment that stays answerable, and gets a name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import AsJson, WritableLog, takes_about

if TYPE_CHECKING:
    from semmap_log.log import About


@takes_about
def run(
    log: WritableLog,
    name: Annotated[str, typer.Argument(metavar="NAME", help="What the moment is called.")],
    *,
    at: Annotated[
        str | None, typer.Option("--at", metavar="TIME", help="The moment; default: now.")
    ] = None,
    as_json: AsJson = False,
    about: About,
) -> None:
    """Give a moment a name, by which it can be queried even when its past is no longer kept.

    `retain` writes the doors of that moment into the log before it takes out what they rest on.
    `--at pin:NAME` asks about it; a pin of the same name takes the place of this one.

    \b
    Examples:
      semmap-log pin office accident --at 2026-03-02T14:02 --actor anna
      semmap-log replay office --at pin:accident
    """
    from semmap_log.cli.door_options import tell
    from semmap_log.log import append

    if not name:
        raise typer.BadParameter("expected a name", param_hint="NAME")
    about["at"] = at
    with append(log) as opened:
        tell(opened.pin(name, **about), as_json=as_json)
