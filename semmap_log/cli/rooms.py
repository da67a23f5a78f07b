"""`rooms`: the rooms of a log's floor plans, and which doors lead where."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli import common

if TYPE_CHECKING:
    from semmap_log.analysis.rooms.level_rooms import RoomPlan
    from semmap_log.log import DoorLog


def run(
    log: common.LogPath,
    *,
    at: common.At = None,
    known_at: common.KnownAt = None,
    event: common.UpToEvent = None,
    level: Annotated[str | None, typer.Option(help="Only this level, by number or name.")] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Write the rooms: .geojson or .tmap2.yaml."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="OUT", help="Draw the rooms into X.png or .svg."),
    ] = None,
    as_json: common.AsJson = False,
) -> None:
    """Show the rooms of a moment, their doors, and where these lead.

    Rooms are what walls and doors enclose on the log's floor plans, whether doors are open or
    shut; below 1 m² they are left out. A room's name is set at its doors, by the annotation
    `rooms` (the room on the left, a comma, the room on the right), else taken from its lift's or
    its doors' names.

    \b
    Files, by the name:
      .geojson      rooms as polygons, in metres of the map frame
      .tmap2.yaml   one level's rooms and doors as a topological map
                    (LCAS/topological_navigation)

    \b
    Examples:
      semmap-log rooms clinic
      semmap-log rooms clinic --level L2 --plot L2.png
      semmap-log rooms clinic --level L2 --out L2.tmap2.yaml
      semmap-log annotate clinic front rooms "lobby,corridor"
    """
    from semmap_log.analysis.rooms.level_rooms import room_plan
    from semmap_log.core.folds.levels import resolve_level
    from semmap_log.interop.formats.json.evaluation_json import rooms_to_json
    from semmap_log.log import read
    from semmap_log.views.join_table import RoomWords, room_table

    opened = read(log)
    common.print_empty_log_hint(opened)
    scope = opened.scope(at, known_at, event)
    common.check_map_recorded(opened, at, known_at, event)
    plan = room_plan(opened, at=scope.at_ns, known_at=scope.known_at_ns, event=scope.event)
    number = None if level is None else resolve_level(level, plan.door_map)
    _check_has_plan(plan, number)
    if out is not None:
        _write(opened, plan, out, number)
    if plot is not None:
        _plot(opened, plan, plot, number)
    if as_json:
        common.print_json(rooms_to_json(plan, level=number))
        return
    words = RoomWords(plan, level=number)
    common.console().print(room_table(plan, words))
    for line in words.notes():
        common.say(line)


def _check_has_plan(plan: RoomPlan, level: int | None) -> None:
    """Say what is missing, where there is nothing to cut rooms from.

    Raises:
        CommandError: No level has a floor plan, or the requested one has none.
    """
    from semmap_log.core.texts import command_line
    from semmap_log.errors import CommandError

    if plan.levels and level in (None, *plan.levels):
        return
    where = "the log" if level is None else f"level {plan.door_map.level_name(level)}"
    if plan.later:
        raise CommandError(f"{where} {plan.why_no_plan(None if level is None else [level])}.")
    how = command_line("import", "LOG", "map.yaml")
    raise CommandError(
        f"{where} has no floor plan then, from which rooms are cut; to give one: {how}"
    )


def _write(log: DoorLog, plan: RoomPlan, out: Path, level: int | None) -> None:
    from semmap_log.interop.exporting.room_files import write_rooms

    write_rooms(log, plan, out, level=level)
    common.say(f"{out}: written.")


def _plot(log: DoorLog, plan: RoomPlan, plot: Path, level: int | None) -> None:
    from semmap_log.core.io.disk import check_outside_log
    from semmap_log.core.model.moments import format_short
    from semmap_log.views.plots.figures import letters_of, save_figure
    from semmap_log.views.plots.room_plans import draw_rooms

    check_outside_log(log.path, plot)
    name = log.info.building or log.path.name
    moment = format_short(plan.door_map.moment_ns, log.info.timezone, seconds=False)
    figure = draw_rooms(plan, level=level, title=f"{name}, {moment}", letters=letters_of(plot))
    save_figure(figure, plot)
    common.say(f"{plot}: written.")
