"""The verbs, in the order in which a new user meets them."""

from __future__ import annotations

from typing import Annotated

import typer

from semmap_log.cli import (
    add,
    annotate,
    best_time,
    calibrate,
    call,
    compact,
    costmap,
    demo,
    diff,
    evaluate,
    export,
    history,
    import_,
    info,
    init,
    observe,
    patrol,
    play,
    probabilities,
    record,
    recover,
    remove,
    replay,
    report,
    retract,
    ros_package,
    serve,
    show,
    tail,
    timeline,
    update,
    verify,
    view,
)

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "color": True},
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
    """


app.command("demo", short_help="The main job in one go, on a shipped recording.")(demo.run)
app.command("init", short_help="Make a new log.")(init.run)
app.command("import", short_help="Import doors, states or events from a file.")(import_.run)
app.command("add", short_help="Add a door.")(add.run)
app.command("update", short_help="Set fields of a door.")(update.run)
app.command("remove", short_help="Take a door out of the map.")(remove.run)
app.command("observe", short_help="Record that a sensor saw a door.")(observe.run)
app.command("annotate", short_help="Say something about a door in words.")(annotate.run)
app.command("retract", short_help="Take events back.")(retract.run)
app.command("patrol", short_help="Mark the start or end of a round.")(patrol.run)
app.command("record", short_help="Record events from standard input.")(record.run)
app.command("replay", short_help="Show the doors at a moment.")(replay.run)
app.command("state", hidden=True)(replay.run)
app.command("history", short_help="Show who changed what, when, why.")(history.run)
app.command("log", hidden=True)(history.run)
app.command("tail", short_help="Show the last events, and those to come.")(tail.run)
app.command("show", short_help="Show one event.")(show.run)
app.command("diff", short_help="Show what differs between two moments.")(diff.run)
app.command("timeline", short_help="Show when a door was open, when closed.")(timeline.run)
app.command("probabilities", short_help="Show how likely doors are open.")(probabilities.run)
app.command("best-time", short_help="Show when a door is likeliest open.")(best_time.run)
app.command("evaluate", short_help="Tell how good forecasts of the doors are.")(evaluate.run)
app.command("calibrate", short_help="Find a sensor's accuracies from known truth.")(calibrate.run)
app.command("export", short_help="Write a file for other programs.")(export.run)
app.command("costmap", short_help="Draw the doors into a costmap.")(costmap.run)
app.command("info", short_help="Show what a log holds.")(info.run)
app.command("verify", short_help="Check that a log is as it was written.")(verify.run)
app.command("recover", short_help="Save what is whole of a damaged log.")(recover.run)
app.command("compact", short_help="Make a log smaller.")(compact.run)
app.command("serve", short_help="Serve the doors in ROS, with the thesis's actions.")(serve.run)
app.command("play", short_help="Publish a log's history live, in ROS.")(play.run)
app.command("ros-package", short_help="Copy the ROS package into a workspace.")(ros_package.run)
app.add_typer(call.app, name="call", short_help="Call an action of a running server, in ROS.")
app.command("report", short_help="Write the history as one page for any browser.")(report.run)
app.command("view", short_help="Look at the history in rerun.")(view.run)
