"""The program: what stands before its verbs."""

from __future__ import annotations

from typing import Annotated

import typer

from semmap_log.cli.verbs import Verbs

app = typer.Typer(
    cls=Verbs,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "color": True},
)


def _version(asked: bool) -> None:  # noqa: FBT001 - typer's callback
    if asked:
        from importlib.metadata import version

        from semmap_log.core.loops import compiled

        loops = "without compiled loops" if compiled() is None else "with compiled loops"
        typer.echo(f"semmap-log {version('semmap-log')} ({loops})")
        raise typer.Exit


@app.callback()
def semmap_log(
    *,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """The flight recorder of a robot's door map.

    Every change and every sighting of a door is an event in an append-only MCAP log; the door
    map of any moment is replayed from it.

    \b
    Examples:
      semmap-log demo                          the main job in one go
      semmap-log init office --tz Europe/Vienna
      semmap-log add office --x 2 --y 1.5 --theta 0 --width 0.9 --name front
      semmap-log observe office front open --accuracy 0.9
      semmap-log replay office --at "2h ago"
      semmap-log view office
    """
