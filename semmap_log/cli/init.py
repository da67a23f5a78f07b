"""`init`: a new log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semmap_log.cli.common import AsJson, MapServer, a_local_log, print_json, say
from semmap_log.core.model.moments import MOST_HOLDS, USUAL_HOLDS

if TYPE_CHECKING:
    from semmap_log.analysis.costmap_2d.map_rules import RulesName
    from semmap_log.core.model.events import FloorMap
    from semmap_log.log import DoorLog


def run(
    log: Annotated[
        Path,
        typer.Argument(
            metavar="LOG", help="The folder to make; or one that is empty.", callback=a_local_log
        ),
    ],
    *,
    tz: Annotated[
        str | None,
        typer.Option(
            "--tz",
            metavar="ZONE",
            help="IANA zone of times without an offset; default: the machine's.",
        ),
    ] = None,
    building: Annotated[str, typer.Option("--building", help="The building's name.")] = "",
    robot: Annotated[str, typer.Option("--robot", help="The robot's name.")] = "",
    holds: Annotated[
        int,
        typer.Option(
            "--holds",
            metavar="GAPS",
            min=0,
            max=MOST_HOLDS,
            help="A sighting of a door holds for so many median gaps between looks at it, then the "
            "door is not seen since. 0: until the next report, as of sensors that report each "
            "change.",
        ),
    ] = USUAL_HOLDS,
    floor_map: Annotated[
        Path | None,
        typer.Option("--map", metavar="MAP.YAML", help="A map_server map: the floor plan."),
    ] = None,
    since: Annotated[
        str | None,
        typer.Option(
            "--since", metavar="TIME", help="From then on the floor plan counts; default: now."
        ),
    ] = None,
    map_rules: Annotated[
        MapServer,
        typer.Option(
            "--map-rules",
            help="The server whose cells the map's pixels become: Nav2 of today, Nav2 before 2025, "
            "or map_server of ROS 1; they differ at thresholds, in greys and in transparency.",
        ),
    ] = MapServer.nav2,
    as_json: AsJson = False,
) -> None:
    """Make a new log.

    \b
    Examples:
      semmap-log init office
      semmap-log init depot --map depot.yaml --tz Europe/Vienna --robot tug1
      semmap-log init depot --map depot.yaml --map-rules noetic
      semmap-log init depot --map depot.yaml --since 2026-01-01
    """
    if since is not None and floor_map is None:
        raise typer.BadParameter("is about a floor plan: give --map, too", param_hint="--since")
    make_log(
        log,
        tz=tz,
        building=building,
        robot=robot,
        holds=holds,
        floor_map=floor_map,
        since=since,
        map_rules=map_rules.value,
        as_json=as_json,
    )


def make_log(
    log: Path,
    *,
    tz: str | None = None,
    building: str = "",
    robot: str = "",
    holds: int = USUAL_HOLDS,
    floor_map: Path | None = None,
    since: str | None = None,
    map_rules: RulesName = "nav2",
    as_json: bool = False,
) -> None:
    """Make a new log, with a floor plan if there is one, and say so."""
    from semmap_log.interop.formats.files.map_server import read_map
    from semmap_log.interop.importing.importing import ImportOptions, import_file
    from semmap_log.log import create

    # Read before anything is made: a map that is none must not leave half a log.
    floor = None if floor_map is None else read_map(floor_map, rules=map_rules)
    since_ns = None if since is None else _since_ns(since, tz)
    with create(log, tz=tz, building=building, robot=robot, holds=holds) as made:
        if floor_map is not None:
            import_file(made, floor_map, ImportOptions(map_rules=map_rules, since_ns=since_ns))
        if as_json:
            print_json(_to_json(log, made, floor))
            return
        said = "as asked" if tz else "the machine's zone; another: --tz ZONE"
        say(f"{log}: a new log; times are in {made.info.timezone} ({said}).")
        if floor is not None:
            height, width = floor.cells.shape
            say(f"Floor plan: {width} x {height} cells of {floor.resolution:.3g} m.")


def _since_ns(text: str, tz: str | None) -> int:
    """Return the time that --since says, before there is a log.

    Raises:
        MomentError: It is none, or is to come.
    """
    from semmap_log.core.io.clock import SystemClock, believable_ns
    from semmap_log.core.model.moments import machine_zone, parse_instant
    from semmap_log.errors import MomentError

    since_ns = parse_instant(text, tz=machine_zone() if tz is None else tz)
    if since_ns > believable_ns(SystemClock()):
        raise MomentError(f"--since: expected a time up to now, got {text!r}.")
    return since_ns


def _to_json(log: Path, made: DoorLog, floor: FloorMap | None) -> dict[str, Any]:
    height, width = (0, 0) if floor is None else floor.cells.shape
    return {
        "log": str(log),
        "log_id": made.info.log_id,
        "timezone": made.info.timezone,
        "building": made.info.building,
        "robot": made.info.robot,
        "holds": made.info.holds,
        "floor_map": None
        if floor is None
        else {"width": width, "height": height, "resolution": floor.resolution},
    }
