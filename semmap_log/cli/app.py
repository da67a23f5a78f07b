"""The verbs, in the order in which a new user meets them."""

from __future__ import annotations

from typing import Annotated

import typer

from semmap_log.cli import (
    add,
    annotate,
    demo,
    diff,
    export,
    history,
    import_,
    info,
    init,
    observe,
    patrol,
    record,
    remove,
    replay,
    show,
    update,
    view,
)

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(asked: bool) -> None:  # noqa: FBT001 - typer's callback
    if asked:
        from importlib.metadata import version

        typer.echo(f"semmap-log {version('semmap-log')}")
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
    """  # noqa: D301 - \b keeps typer from joining the lines


app.command("demo")(demo.run)
app.command("init")(init.run)
app.command("import")(import_.run)
app.command("add")(add.run)
app.command("update")(update.run)
app.command("remove")(remove.run)
app.command("observe")(observe.run)
app.command("annotate")(annotate.run)
app.command("patrol")(patrol.run)
app.command("record")(record.run)
app.command("replay")(replay.run)
app.command("state", hidden=True)(replay.run)
app.command("history")(history.run)
app.command("log", hidden=True)(history.run)
app.command("show")(show.run)
app.command("diff")(diff.run)
app.command("export")(export.run)
app.command("info")(info.run)
app.command("view")(view.run)
