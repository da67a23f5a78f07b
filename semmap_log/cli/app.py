"""The verbs, in groups, in the order in which a new user meets them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import typer

from semmap_log.cli import (
    add,
    annotate,
    ask,
    best_time,
    calibrate,
    call,
    compact,
    costmap,
    demo,
    diff,
    evaluate,
    export,
    fetch,
    fleet,
    go,
    history,
    import_,
    index,
    info,
    init,
    join,
    observe,
    oprs_package,
    patrol,
    patrol_plan,
    play,
    probabilities,
    prolog_module,
    record,
    recover,
    remove,
    replay,
    report,
    retract,
    rooms,
    ros_package,
    scan_report,
    serve,
    ship,
    show,
    sql,
    tail,
    timeline,
    update,
    verify,
    view,
)
from semmap_log.cli.caching import with_cache
from semmap_log.cli.verbs import HELP_MADE_LATE, Verb, Verbs

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


VERBS: dict[str, tuple[tuple[str, Callable[..., None], str], ...]] = {
    "First steps": (
        ("demo", demo.run, "The main job in one go, on a shipped recording."),
        ("init", init.run, "Make a new log."),
        ("import", import_.run, "Import doors, states or events from a file."),
    ),
    "Write what happens": (
        ("add", add.run, "Add a door."),
        ("update", update.run, "Set fields of a door."),
        ("remove", remove.run, "Take a door out of the map."),
        ("observe", observe.run, "Record that a sensor saw a door."),
        ("annotate", annotate.run, "Say something about a door in words."),
        ("patrol", patrol.run, "Mark the start or end of a round."),
        ("record", record.run, "Record events from standard input, or from ROS."),
        ("retract", retract.run, "Take events back."),
    ),
    "Ask what was, when, and why": (
        ("replay", replay.run, "Show the doors at a moment."),
        ("history", history.run, "Show who changed what, when, why."),
        ("tail", tail.run, "Show the last events, and those to come."),
        ("show", show.run, "Show one event."),
        ("diff", diff.run, "Show what differs between two moments."),
        ("timeline", timeline.run, "Show when a door was open, when closed."),
        ("rooms", rooms.run, "Show the rooms, and which doors lead where."),
        ("sql", sql.run, "Answer a query in SQL."),
    ),
    "Ask what is likely": (
        ("probabilities", probabilities.run, "Show how likely doors are open."),
        ("best-time", best_time.run, "Show when a door is likeliest open."),
        ("patrol-plan", patrol_plan.run, "Plan in which order to visit rooms."),
        ("go", go.run, "Plan a trip: wait, ask, or go round."),
        ("evaluate", evaluate.run, "Tell how good forecasts of the doors are."),
        ("calibrate", calibrate.run, "Find a sensor's accuracies from known truth."),
        ("scan-report", scan_report.run, "Tell how a laser saw the doors; draw it."),
    ),
    "Pictures, and files for other programs": (
        ("view", view.run, "Look at the history in rerun."),
        ("report", report.run, "Write the history as one page for any browser."),
        ("costmap", costmap.run, "Draw the doors into a costmap."),
        ("export", export.run, "Write a file for other programs."),
    ),
    "Live in ROS, and for planners": (
        ("serve", serve.run, "Serve the doors in ROS, and to planners."),
        ("play", play.run, "Publish a log's history."),
        ("ask", ask.run, "Ask a server what planners ask."),
        ("ros-package", ros_package.run, "Copy the ROS package into a workspace."),
        ("oprs-package", oprs_package.run, "Copy the module for kernels of OpenPRS."),
        ("prolog-module", prolog_module.run, "Copy the module for SWI-Prolog."),
    ),
    "Care of the log": (
        ("info", info.run, "Show what a log holds."),
        ("verify", verify.run, "Check that a log is as it was written."),
        ("recover", recover.run, "Save what is whole of a damaged log."),
        ("compact", compact.run, "Make a log smaller."),
        ("index", index.run, "Make a log quick to ask about single doors."),
    ),
    "Many robots": (
        ("ship", ship.run, "Send a log to a store."),
        ("fetch", fetch.run, "Bring a log back from a store."),
        ("join", join.run, "Join robots' logs of one building."),
        ("fleet", fleet.run, "Ask many logs one question."),
    ),
}
"""Group -> its verbs, as --help shows them: name, what runs it, and what it does in a line."""


def _kinds_of_lines() -> str:
    from semmap_log.formats.json.event_json_keys import help_text

    return help_text()


HELP_MADE_LATE["record"] = _kinds_of_lines

for _group, _verbs in VERBS.items():
    for _name, _run, _does in _verbs:
        _cached = with_cache(_run, caches=_run is not verify.run)  # verify believes no cache
        app.command(_name, cls=Verb, short_help=_does, rich_help_panel=_group)(_cached)
app.add_typer(
    call.app,
    name="call",
    short_help="Call an action of a running server.",
    rich_help_panel="Live in ROS, and for planners",
)
app.command("state", cls=Verb, hidden=True)(with_cache(replay.run))
app.command("log", cls=Verb, hidden=True)(with_cache(history.run))
