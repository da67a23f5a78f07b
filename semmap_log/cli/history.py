"""`history`: who changed what, when, why."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli import common

if TYPE_CHECKING:
    from semmap_log.views.plots.lanes import Lanes


def run(
    log: common.LogPath,
    door: Annotated[
        str | None, typer.Argument(metavar="DOOR", help="Only events about this door.")
    ] = None,
    *,
    since: common.Since = None,
    until: common.Until = None,
    recorded: Annotated[
        bool, typer.Option("--recorded", help="The range is of recorded time.")
    ] = False,
    object_class: common.OfClass = None,
    kind: Annotated[
        list[str] | None,
        typer.Option("--kind", metavar="KIND", help="Only this kind, such as DoorObserved."),
    ] = None,
    last: Annotated[
        int | None, typer.Option("--last", "-n", min=1, metavar="N", help="Only the last N.")
    ] = None,
    poses: Annotated[bool, typer.Option("--poses", help="Show the robot's poses, too.")] = False,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="X.png|svg", help="Draw the states as lanes instead."),
    ] = None,
    palette: common.PaletteChoice = common.PaletteName.default,
    as_json: common.AsJson = False,
) -> None:
    """Show the events of the log, or of one door: what, when, who, why.

    The table leaves out robot poses by default; times are in the log's zone.

    The range is half-open: since <= time < until. Retracted events are shown, and marked.
    --plot draws when each door was open, closed or unknown, and the patrol rounds, as far as
    that is known today.

    \b
    Examples:
      semmap-log history office front
      semmap-log history office --since yesterday --kind DoorUpdated
      semmap-log history office --since 2026-03-02T08:00..2026-03-02T12:00
      semmap-log history office -n 20 --json
      semmap-log history office --since yesterday --plot lanes.svg
    """
    from semmap_log.core.model.events import KIND_BY_NAME, KINDS, RobotPose, UnknownEvent
    from semmap_log.interop.formats.json.door_json import entry_to_json
    from semmap_log.log import read

    for name in kind or []:
        if name not in KIND_BY_NAME:
            known = ", ".join(KIND_BY_NAME)
            raise typer.BadParameter(f"{name!r}: expected one of {known}", param_hint="--kind")
    opened = read(log)
    common.print_empty_log_hint(opened)
    start, end = common.range_of(opened, since, until)
    doors = common.doors_meant(opened, None if door is None else [door], object_class)
    door_id = doors[0] if doors and door else None
    if plot is not None:
        if recorded or kind or last or poses or as_json:
            raise typer.BadParameter(
                "draws the states; it goes with DOOR, --since, --until and --palette only",
                param_hint="--plot",
            )
        from semmap_log.core.io.disk import check_outside_log
        from semmap_log.views.plots.lanes import Lanes  # needs matplotlib

        check_outside_log(opened.path, plot)
        with common.progress("Reading") as told:
            lanes = Lanes.of(opened, doors, start, end, progress=told)
        _draw(lanes, plot, palette)
        return
    kinds = [KIND_BY_NAME[name] for name in kind] if kind else [*KINDS, UnknownEvent]
    if not (kind or poses or as_json):
        kinds.remove(RobotPose)
    entries = opened.history(
        door_id,
        start,
        end,
        recorded=recorded,
        kinds=kinds,
        object_class=object_class,
    )
    if last is not None:
        entries = iter(deque(entries, maxlen=last))
    if as_json:
        common.print_json_list(entry_to_json(entry) for entry in entries)
        return
    from semmap_log.views.tables import history_pages

    out = common.console()
    names = opened.door_names()
    is_empty = True
    tz, objects = opened.info.timezone, opened.objects()
    for page in history_pages(entries, tz=tz, names=names, objects=objects):
        out.print(page)
        is_empty = is_empty and page.is_empty
    if is_empty:
        common.say(
            "no events; times count when it happened, or with --recorded when it was recorded."
        )


def _draw(lanes: Lanes, path: Path, palette: common.PaletteName) -> None:
    from semmap_log.errors import CommandError
    from semmap_log.views.plots.lanes import plot_lanes

    if not lanes.doors and not lanes.rounds:
        raise CommandError("no door was in the map then; nothing is drawn.")
    plot_lanes(lanes, path, palette.colours)
    common.say(f"{path}: doors: {len(lanes.doors)}, rounds: {len(lanes.rounds)}.")
