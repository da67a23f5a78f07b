"""`patrol-plan`: in which order to visit rooms or doors."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli import common
from semmap_log.cli.patrol_following import follow as follow_round
from semmap_log.cli.probabilities import PLOTS, Estimator, Zone
from semmap_log.cli.sanitized_streams import json_text, write_line

if TYPE_CHECKING:
    from semmap_log.analysis.planning.patrol_plan import PatrolPlan
    from semmap_log.log import DoorLog

Speed = Annotated[
    float, typer.Option("--speed", metavar="M/S", help="How fast the robot is, metres a second.")
]
SPEED_M_S = 0.7


def run(
    log: common.LogPath,
    *,
    start_at: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="PLACE",
            help="X,Y or X,Y,LEVEL, a room, or a door; default: where the log saw the robot last.",
        ),
    ] = None,
    rooms: Annotated[
        list[str] | None,
        typer.Option("--rooms", metavar="A,B", help="Rooms to visit, by number or name."),
    ] = None,
    doors: Annotated[
        list[str] | None,
        typer.Option("--doors", metavar="A,B", help="Doors to go through, by id or name."),
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="All rooms; without rooms, all doors: the default.")
    ] = False,
    start: Annotated[
        str | None,
        typer.Option("--start", metavar="TIME", help="When it starts; default: the log's end."),
    ] = None,
    speed: Speed = SPEED_M_S,
    budget: Annotated[
        str | None, typer.Option("--budget", metavar="60min", help="How long it may take.")
    ] = None,
    enter: Annotated[
        str, typer.Option("--enter", metavar="17s", help="To go into a room and come out.")
    ] = "17s",
    wait: Annotated[
        str, typer.Option("--wait", metavar="10s", help="How long to wait at a shut door.")
    ] = "10s",
    asks: Annotated[
        bool, typer.Option("--asks", help="It may ask for doors: P is that of passing.")
    ] = False,
    skip_below: Annotated[
        float | None,
        typer.Option(
            "--skip-below",
            metavar="P",
            min=0,
            max=1,
            help="Leave out doors that at such hours are open less than that at the upper end of "
            "the 90 % interval (.4), are unlikely open now, and were looked at within a day. "
            "0: none.",
        ),
    ] = None,
    estimator: Estimator = None,
    tz: Zone = None,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="X.png", help="Draw it over the floor plan; or .svg."),
    ] = None,
    follow: Annotated[
        bool,
        typer.Option(
            "--follow",
            "-f",
            help="Then follow the log: the next stop after each event, until the "
            "round is over, or Ctrl-C. With --json one object a line, the plan first.",
        ),
    ] = False,
    as_json: common.AsJson = False,
) -> None:
    """Plan a patrol: in which order to visit rooms, so that the mean time to visit is least.

    P is how likely each door is open when the robot comes to it, by all that was known at the
    start. Doors that are likely open and near come first. A door that was found shut again and
    again at such hours is left out, but looked at once a day: what is not tried is not learnt. One
    of which too little was seen is UNKNOWN, and counts as the others on average.

    With --follow, a door is visited once the robot passed it, or is on its other side. One that it
    gave up, or that is seen shut where it was sent to, is tried no more. Reports of doors ahead
    count; the order is made again only when the expected state of one changes.

    \b
    Examples:
      semmap-log patrol-plan office
      semmap-log patrol-plan office --from 2,1.5 --start 2026-03-02T08:00
      semmap-log patrol-plan office --budget 30min --wait 5s
      semmap-log patrol-plan office --rooms 2,3 --json
      semmap-log patrol-plan office --doors front,side --plot plan.png
      semmap-log patrol-plan office --rooms 2,3 --follow
    """
    from semmap_log.analysis.planning.door_chances import SkipRule
    from semmap_log.analysis.planning.patrol_plan import PatrolOptions, listed
    from semmap_log.analysis.planning.round_planner import begun_round
    from semmap_log.core.io.disk import check_outside_log
    from semmap_log.interop.formats.json.plan_json import plan_to_json
    from semmap_log.log import read
    from semmap_log.views.patrol_plan_table import patrol_plan_table

    if everything and (rooms or doors):
        raise typer.BadParameter("leave out --rooms and --doors, or --all", param_hint="--all")
    for option, given in (("--rooms", rooms), ("--doors", doors)):
        if given and not listed(given):
            raise typer.BadParameter("expected names, got none", param_hint=option)
    if plot is not None and plot.suffix not in PLOTS:
        raise typer.BadParameter(f"expected a name that ends in .png or .svg, got {plot}",
                                 param_hint="--plot")  # fmt: skip
    opened = read(log)
    common.check_map_recorded(opened, start, None)
    if plot is not None:
        check_outside_log(opened.path, plot)
    options = PatrolOptions(
        speed_m_s=speed,
        budget_s=None if budget is None else seconds_of(budget, "--budget"),
        enter_s=seconds_of(enter, "--enter"),
        wait_s=seconds_of(wait, "--wait"),
        asks=asks,
        skip=SkipRule() if skip_below is None else SkipRule(skip_below),
    )
    with common.progress("Reading") as told:
        begun = begun_round(
            opened, start_at=start_at, rooms=listed(rooms or ()), doors=listed(doors or ()),
            start=start, estimator=estimator, tz=tz, options=options, progress=told,
        )  # fmt: skip
    plan = begun.plan
    if plot is not None:
        _plot(opened, plan, plot)
    if as_json and follow:
        write_line(json_text(plan_to_json(plan)))
    elif as_json:
        common.print_json(plan_to_json(plan))
    else:
        common.console().print(patrol_plan_table(plan))
    if follow:
        follow_round(opened, begun, as_json=as_json)


def seconds_of(text: str, option: str) -> float:
    """Return a length of time in seconds; `0` and `0s` are lengths, too.

    Args:
        text: As it was typed.
        option: Where, for messages.

    Raises:
        MomentError: It is none.
    """
    from semmap_log.core.model.moments import SECOND_NS, parse_duration
    from semmap_log.errors import MomentError

    if text.strip() == "0":
        return 0.0
    try:
        return parse_duration(text) / SECOND_NS
    except MomentError as error:
        raise MomentError(f"{option}: {error}") from None


def _plot(opened: DoorLog, plan: PatrolPlan, path: Path) -> None:
    from semmap_log.analysis.planning.patrol_plan import WaysBetween, patrol_ways
    from semmap_log.analysis.rooms.level_rooms import room_plan
    from semmap_log.core.texts import counted
    from semmap_log.views.plots.patrol_route import plot_patrol

    at = None if plan.start_ns > plan.known_ns else f"@{plan.start_ns}"
    rooms = room_plan(opened, at=at)
    ways = patrol_ways(plan, WaysBetween(rooms, speed_m_s=plan.options.speed_m_s))
    plot_patrol(plan, ways, rooms.floors, list(rooms.door_map.doors.values()), path)
    common.say(f"{path}: {counted(len(plan.stops), 'stop')}.")
