"""`costmap`: the doors of a moment as a costmap."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli import common
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.analysis.costmaps import Costmap, CostmapOptions
    from semmap_log.core.model.doors import Door, DoorMap
    from semmap_log.core.model.events import FloorMap
    from semmap_log.core.model.moments import Time
    from semmap_log.interop.exporting.costmap_files import Part, RecordedCostmap
    from semmap_log.log import DoorLog


MOST_NAMED = 3
"""So many of the doors that are left out for one reason are named; --json has all."""


class Layer(str, Enum):
    """Which grid of the costmap, as typer wants its choices."""

    master = "master"
    door = "door"


class CostSource(str, Enum):
    """`semmap_log.analysis.costmaps.door_layer_fold.By`, as typer wants its choices."""

    state = "state"
    belief = "belief"


def run(
    log: common.LogPath,
    out: common.OutFile,
    *,
    at: common.At = None,
    known_at: common.KnownAt = None,
    event: common.UpToEvent = None,
    level: Annotated[str | None, typer.Option(help="Level, by number or name.")] = None,
    floor_map: Annotated[
        Path | None,
        typer.Option("--map", metavar="MAP.YAML", help="The floor; default: the log's own."),
    ] = None,
    map_rules: Annotated[
        common.MapServer | None,
        typer.Option("--map-rules", help="As which map_server to read --map; nav2."),
    ] = None,
    layer: Annotated[
        Layer | None,
        typer.Option("--layer", help="All together (default), or the doors without floor."),
    ] = None,
    keepout: Annotated[
        bool, typer.Option("--keepout", help="A mask of closed doors for Nav2's keepout filter.")
    ] = False,
    by: Annotated[
        CostSource, typer.Option("--by", help="What doors cost: by their state, or by P(open).")
    ] = CostSource.state,
    inflate: Annotated[
        float,
        typer.Option("--inflate", metavar="M", help="Reach of costs around obstacles, metres."),
    ] = 0.0,
    door_inflate: Annotated[
        float,
        typer.Option("--door-inflate", metavar="M", help="The same around doors that may close."),
    ] = 0.0,
    scaling: Annotated[
        float | None,
        typer.Option("--scaling", metavar="S", help="How fast costs fall off, 1/m; default: 10."),
    ] = None,
    inscribed: Annotated[
        float | None,
        typer.Option("--inscribed", metavar="M", help="The robot's inscribed radius, metres."),
    ] = None,
    object_class: common.OfClass = None,
    resolution: Annotated[
        float | None,
        typer.Option("--resolution", metavar="M", help="Without a floor: metres a cell; 0.05."),
    ] = None,
    since: Annotated[
        str | None,
        typer.Option("--since", metavar="TIME", help="A bag's first moment; or T1..T2."),
    ] = None,
    until: Annotated[
        str | None, typer.Option("--until", metavar="TIME", help="A bag's last moment.")
    ] = None,
    every: Annotated[
        float | None,
        typer.Option("--every", metavar="S", help="Whole grids at most so often; 60. 0: always."),
    ] = None,
    updates: Annotated[
        bool | None,
        typer.Option("--updates/--no-updates", help="Each change as an update, too (default)."),
    ] = None,
    as_json: common.AsJson = False,
) -> None:
    """Draw the doors of a moment into a costmap, cell for cell as ROS's costmap_2d would.

    A closed door is lethal, an open one free (it cuts its opening into a wall), any other shows
    what is below it. Without a floor map, in the log or by --map, the grid lies around the doors.
    Files are written whole or not at all; old ones of that name are replaced at once.

    \b
    Formats, by the file's name:
      .yaml, .pgm   a ROS map for map_server and Nav2, both files; its values are
                    those that costmap_2d publishes (0..100, unknown -1)
      .png          a picture for people
      .npy          the costs: uint8 (height, width), row 0 at the lowest y;
                    0 free, 253 inscribed, 254 lethal, 255 unknown
      .mcap, .bag   over time, for players (RViz, Foxglove, rerun):
                    nav_msgs/OccupancyGrid on /semmap/costmap, and what changed on
                    /semmap/costmap_updates; without an extension: the same as a
                    rosbag2 folder

    \b
    Examples:
      semmap-log costmap office office.png --inflate 0.55 --inscribed 0.2
      semmap-log costmap office map.yaml --at "yesterday 14:00"
      semmap-log costmap clinic L2.npy --level L2 --layer door
      semmap-log costmap office keepout.yaml --keepout
      semmap-log costmap office p.png --by belief --inflate 0.3 --door-inflate 0.8
      semmap-log costmap office day.mcap --since 08:00 --until 18:00 --inflate 0.4
    """
    from semmap_log.analysis.costmaps import CostmapOptions, costmap_at
    from semmap_log.interop.exporting.costmap_files import write_costmap
    from semmap_log.interop.formats.bags.bag_reading import is_bag_name
    from semmap_log.interop.formats.files.map_server import read_map
    from semmap_log.interop.formats.json.plan_json import costmap_to_json
    from semmap_log.log import read

    common.check_not_nan(
        inflate=inflate,
        door_inflate=door_inflate,
        scaling=scaling,
        inscribed=inscribed,
        resolution=resolution,
        every=every,
    )
    part = _part(layer, keepout=keepout)
    inflates = inflate != 0 or door_inflate != 0
    _check_useful(part, inflates=inflates, scaling=scaling, inscribed=inscribed)
    of_a_moment = {"--at": at, "--known-at": known_at, "--event": event,
                   "--keepout": keepout or None}  # fmt: skip
    over_time = {"--since": since, "--until": until, "--every": every, "--updates": updates}
    is_bag = is_bag_name(out)
    _check_not_given(of_a_moment if is_bag else over_time, out, is_bag=is_bag)
    opened = read(log)
    common.print_empty_log_hint(opened)
    options = CostmapOptions(
        level=level,
        by=by.value,
        inflate_m=inflate,
        door_inflate_m=door_inflate,
        scaling=10.0 if scaling is None else scaling,
        inscribed_m=inscribed or 0.0,
        resolution=0.05 if resolution is None else resolution,
        object_class=object_class,
    )
    floor = None
    if floor_map is not None:
        floor = read_map(floor_map, rules=(map_rules or common.MapServer.nav2).value)
    elif map_rules is not None:
        raise typer.BadParameter("how to read --map, which is not given", param_hint="--map-rules")
    if is_bag:
        span = common.range_of(opened, since, until)
        done = _record(
            opened, out, options, span, layer=layer or Layer.master,
            every=60.0 if every is None else every, updates=updates is not False, floor=floor,
        )  # fmt: skip
        _say_recorded(out, done, as_json=as_json)
        return
    scope = opened.scope(at, known_at, event)
    common.check_map_recorded(opened, at, known_at, event)
    costmap = costmap_at(
        opened, options, at=scope.at_ns, known_at=scope.known_at_ns, event=scope.event, floor=floor
    )
    if costmap.floor is not None and resolution is not None:
        raise typer.BadParameter(
            f"the floor map has cells of {costmap.floor.resolution:.4g} m; leave the option out",
            param_hint="--resolution",
        )
    made = write_costmap(opened, costmap, out, part, scope=scope)
    if as_json:
        common.print_json(
            costmap_to_json(
                costmap, made.doors, made.left_out, part=part, files=made.files, scope=scope
            )
        )
        return
    _print_left_out(made.left_out, costmap.doors)
    if costmap.floor is None:
        common.say("no floor map then: the grid lies around the doors; another: --map MAP.YAML")
    common.say(f"{', '.join(map(str, made.files))}: {_told(costmap, made.doors)}")


def _record(
    log: DoorLog,
    out: Path,
    options: CostmapOptions,
    span: tuple[Time, Time],
    *,
    layer: Layer,
    every: float,
    updates: bool,
    floor: FloorMap | None,
) -> RecordedCostmap:
    from semmap_log.interop.exporting.costmap_files import record_costmap

    with common.progress("Drawing", unit="ns") as told:
        return record_costmap(
            log, out, options, since=span[0], until=span[1], which=layer.value, every_s=every,
            updates=updates, floor=floor, progress=told,
        )  # fmt: skip


def _say_recorded(out: Path, done: RecordedCostmap, *, as_json: bool) -> None:
    if as_json:
        common.print_json({"file": str(out), **asdict(done)})
    else:
        made = f"{counted(done.grids, 'grid')}, {counted(done.updates, 'update')}"
        common.say(f"{out}: {made}, {common.size_of(done.bytes)}.")


def _check_not_given(options: Mapping[str, object], out: Path, *, is_bag: bool) -> None:
    """Refuse options that mean nothing for a file of that kind."""
    given = [name for name, value in options.items() if value is not None]
    if given:
        instead = "shows a range: --since, --until" if is_bag else "shows one moment: --at"
        raise typer.BadParameter(f"{out.name} {instead}", param_hint=", ".join(given))


def _part(layer: Layer | None, *, keepout: bool) -> Part:
    if keepout and layer is Layer.master:
        raise typer.BadParameter("a mask shows doors only; leave one out", param_hint="--keepout")
    return "keepout" if keepout else "door" if layer is Layer.door else "master"


def _check_useful(
    part: Part, *, inflates: bool, scaling: float | None, inscribed: float | None
) -> None:
    """Refuse options that would change nothing: somebody meant something by them."""
    if part != "master" and inflates:
        raise typer.BadParameter(
            "costs around obstacles are in the master only; leave it out",
            param_hint="--inflate, --door-inflate",
        )
    if not inflates and not (scaling is inscribed is None):
        raise typer.BadParameter(
            "how costs fall off; how far they reach is --inflate or --door-inflate",
            param_hint="--scaling, --inscribed",
        )


def _print_left_out(left_out: Sequence[tuple[Door, str]], door_map: DoorMap) -> None:
    """Say a line for each reason, with the first of the doors."""
    from semmap_log.core.folds.door_index import labels_of

    labels = labels_of(door_map)
    reasons = dict.fromkeys(why for _, why in left_out)
    for reason in reasons:
        doors = [labels.get(door.door_id, door.label) for door, why in left_out if why == reason]
        more = ", …" if len(doors) > MOST_NAMED else ""
        named = ", ".join(doors[:MOST_NAMED])
        common.say(f"left out: {counted(len(doors), 'door')} {reason}: {named}{more}")


def _told(costmap: Costmap, doors: Sequence[Door]) -> str:
    """Return what was drawn: cells, and doors by their state."""
    geometry = costmap.geometry
    states = Counter(door.state.name.lower() for door in doors)
    by_state = ", ".join(f"{count} {state}" for state, count in sorted(states.items()))
    return (
        f"{geometry.width:,} x {geometry.height:,} cells of {geometry.resolution:.4g} m, "
        f"{counted(len(doors), 'door')}" + (f" ({by_state})." if doors else ".")
    )
