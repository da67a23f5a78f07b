"""`serve`: the thesis's server, live in ROS; and what planners ask, with ROS or without."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli import writing_options
from semmap_log.cli.ask import (
    ASK_POLL_S,
    TICK_S,
    AnyHost,
    AskAt,
    Asking,
    AskNow,
    Now,
    Planners,
    TokenFile,
)
from semmap_log.cli.common import (
    MapServer,
    PaletteName,
    check_not_nan,
    on_stop,
    say,
    stopped_for_good,
)
from semmap_log.cli.costmap import CostSource
from semmap_log.cli.init import make_log
from semmap_log.cli.ros import Ros1, Ros2, chosen_ros, open_node
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.core.model.doors import DoorMap
    from semmap_log.core.model.events import FloorMap

NODE = "lta_semantic_map_server"


def run(
    context: typer.Context,
    log: Annotated[
        Path | None, typer.Argument(metavar="LOG", help="The log's folder; it must be there.")
    ] = None,
    *,
    log_option: Annotated[
        Path | None,
        typer.Option(
            "--log", metavar="LOG", help="Instead: a log that is made if it is not there."
        ),
    ] = None,
    tz: Annotated[
        str | None,
        typer.Option(
            "--tz", metavar="ZONE", help="IANA zone of a log that --log makes; the machine's."
        ),
    ] = None,
    ros1: Ros1 = False,
    ros2: Ros2 = False,
    ask: AskAt = None,
    ask_any_host: AnyHost = False,
    token_file: TokenFile = None,
    ask_now: AskNow = Now.clock,
    yaml: Annotated[
        Path | None,
        typer.Option("--yaml", metavar="FILE", help="The thesis's doors: see above."),
    ] = None,
    yaml_replace: Annotated[
        bool, typer.Option("--yaml-replace", help="Make the log's doors those of --yaml.")
    ] = False,
    save_root: Annotated[
        Path | None,
        typer.Option(
            "--save-root",
            metavar="DIR",
            help="SaveDoorDB writes in it; default: --yaml's folder, else LOG_saved.",
        ),
    ] = None,
    default_prob: Annotated[
        float | None,
        typer.Option(
            "--default-prob",
            metavar="P",
            min=0,
            max=1,
            help="Of doors that have none: in DoorMap and saved files.",
        ),
    ] = None,
    level: Annotated[
        str | None, typer.Option(help="Where new doors are, and --map; default: the only level.")
    ] = None,
    costmap: Annotated[
        bool, typer.Option("--costmap", help="Publish grids for move_base and Nav2.")
    ] = False,
    by: Annotated[
        CostSource,
        typer.Option("--by", help="What doors cost there: by their state, or by P(open)."),
    ] = CostSource.state,
    door_inflate: Annotated[
        float,
        typer.Option(
            "--door-inflate", metavar="M", min=0, help="Reach of costs around doors that may close."
        ),
    ] = 0.0,
    scaling: Annotated[
        float | None,
        typer.Option(
            "--scaling", metavar="S", min=0, help="How fast these fall off, 1/m; default: 10."
        ),
    ] = None,
    floor_map: Annotated[
        Path | None,
        typer.Option("--map", metavar="MAP.YAML", help="Their floor; default: the log's own."),
    ] = None,
    map_rules: Annotated[
        MapServer, typer.Option("--map-rules", help="As which map_server to read --map.")
    ] = MapServer.nav2,
    plan: Annotated[
        bool, typer.Option("--plan", help="Publish the stops of the patrol that are left.")
    ] = False,
    rooms: Annotated[
        list[str] | None,
        typer.Option("--rooms", metavar="A,B", help="Rooms that it visits; default: all."),
    ] = None,
    doors_to_visit: Annotated[
        list[str] | None,
        typer.Option("--doors", metavar="A,B", help="Doors that it goes through."),
    ] = None,
    palette: Annotated[
        PaletteName, typer.Option("--palette", help="Colours of the markers.")
    ] = PaletteName.default,
    read_only: Annotated[
        bool, typer.Option("--read-only", help="Offer the map, refuse the actions; no lock.")
    ] = False,
    durability: Annotated[
        writing_options.SyncChoice,
        typer.Option(help="What is true of a goal when it is answered; see above."),
    ] = writing_options.SyncChoice.event,
    batch_events: Annotated[
        int, typer.Option(min=1, help="batch: so many events at most are not yet synced.")
    ] = 64,
    batch_ms: Annotated[
        float, typer.Option(min=0, help="batch: after so long at most they are.")
    ] = 50.0,
    ship: writing_options.ShipTo = None,
    sign_key: writing_options.SignKey = None,
    sign_every: writing_options.SignEvery = writing_options.EVERY,
    adopt: writing_options.Adopt = False,
) -> None:
    """Serve a log's doors in ROS, as the thesis's server did, and to planners, until Ctrl-C.

    Each goal is one commit: its id is the command's, its client the actor. A goal that is sent
    again, after a crash of either side, is answered as the first time. Whoever is in the ROS
    network may send goals; --read-only takes none, and follows what another process writes.

    \b
    Topics, latched (ROS 2: transient_local), sent at each change:
      lta_semantic_map_door_db  the thesis's DoorMap; NaN: not given
      semmap/doors              MarkerArray for RViz
      semmap/costmap            --costmap: floor and doors, for a StaticLayer
      semmap/door_layer         --costmap: doors alone, for a KeepoutFilter
      …_updates                 --costmap: what changed of them; not latched
      semmap/patrol_plan        --plan: PoseArray, where to go next first
    With several levels: semmap/doors/level_1, …; 0 has no suffix.

    \b
    Actions, and the ROS parameters that name them otherwise:
      lta_semantic_map/add_door      add_door
      lta_semantic_map/update_door   update_door
      lta_semantic_map/remove_door   remove_door
      lta_semantic_map/save_door_db  save_door_db

    With --plan the stops are those of `patrol-plan --follow`: where to stand before each door. The
    round is the log's (PatrolStarted, PatrolFinished), or one from the server's start in a log
    that has none; when it is over, the array is empty until the next is started.

    With --ask ADDRESS programs that plan ask about the doors and set them, a line a question, over
    a socket that only this user can open (unix:PATH), or a port that only this machine reaches:
    `semmap-log ask ADDRESS HELP` names the questions. Many may ask at once.

    With --log LOG the first start makes the log, as `init` does: with --yaml a plain file of doors
    is all that a server needs.

    --yaml FILE fills a log that never had doors. Later it must agree with the log, or be a file
    that the log took in, or saved, and that has not changed since; else the server stops and says
    what differs. --yaml-replace then adds, updates and removes doors, in one commit; one that was
    removed comes back under its id.

    SaveDoorDB writes YAML into one folder: --save-root, else that of --yaml, else LOG_saved next to
    the log (office_saved), made when it is needed. A probability that a door does not have is left
    out of it, unless --default-prob gives one.

    With --ship each segment is sent to a store once it is closed (after a day, 10,000 commits or 64
    MiB, and at the end), by a thread that no goal waits for. A store that cannot be reached is
    reported once and tried again, at most ten minutes apart. The end waits 30 s for what is being
    sent; what is not sent then is sent the next time, or by `ship`.

    With --sign-key the log's end is signed each minute (--sign-every) and when it is closed, by a
    thread that no goal waits for, and only what this server wrote. What cannot be signed (a full
    disk) is reported once, and signed later, or by `sign`. Events found unsigned at the start, as a
    power cut leaves them, are signed by `sign` first, or with --adopt.

    Exit code 2: the server would never start like this (no log, a wrong option or file).

    \b
    Durability, when a goal is answered:
      event  it survives a power cut (goals that come together share their syncs)
      batch  it will, after --batch-ms at most
      flush  it survives the end of this program, not a power cut
      none   it may still be in memory; all is on the disk when the program ends

    \b
    Examples:
      semmap-log serve office --ros2 --yaml doors.yaml
      semmap-log serve --log office --ros1 --yaml doors.yaml
      semmap-log serve office --ros1 --costmap --by belief --door-inflate 0.8
      semmap-log serve office --ros1 --costmap --map map.yaml
      semmap-log serve office --ros2 --read-only --plan --rooms 2,3
      semmap-log serve office --ros2 --read-only --ros-args -r __ns:=/robot1
      semmap-log serve office --ros1 _add_door:=doors/add
      semmap-log serve office --ask unix:/run/doors.sock
      semmap-log serve office --ros2 --ship s3://hospital/logs/office
      semmap-log serve office --ros2 --sign-key ~/.ssh/office
    """
    from semmap_log.analysis.costmaps.level_costmap import CostmapOptions
    from semmap_log.analysis.planning.patrol_plan import listed
    from semmap_log.live.ros.serving.door_server import DoorServer
    from semmap_log.live.ros.serving.saving import DoorSaver
    from semmap_log.live.ros.serving.served_topics import PatrolWish
    from semmap_log.live.ros.serving.server import ServeOptions, Server
    from semmap_log.live.ros.serving.yaml_start import POLL_S, DoorFollower, start_with_yaml
    from semmap_log.log import append

    asking = Asking.of(ask, token_file, any_host=ask_any_host)
    planners = Planners.of(asking, ask_now)
    is_in_ros = ros1 or ros2
    if not is_in_ros and planners is None:
        raise typer.BadParameter(
            "say whom to serve: ROS by --ros1 or --ros2, planners by --ask ADDRESS",
            param_hint="--ros1, --ros2, --ask",
        )
    version = chosen_ros(ros1=ros1, ros2=ros2) if is_in_ros else None
    check_not_nan(default_prob=default_prob, door_inflate=door_inflate, scaling=scaling)
    if yaml_replace and yaml is None:
        raise typer.BadParameter("only with --yaml", param_hint="--yaml-replace")
    for name, is_given in {
        "--costmap": costmap,
        "--plan": plan,
        "--save-root": save_root is not None,
    }.items():
        if is_given and not is_in_ros:
            raise typer.BadParameter("only with --ros1 or --ros2", param_hint=name)
    of_costmap = {
        "--map": floor_map is not None,
        "--by": by != CostSource.state,
        "--door-inflate": door_inflate != 0,
        "--scaling": scaling is not None,
    }
    for name, is_given in of_costmap.items():
        if is_given and not costmap:
            raise typer.BadParameter("only with --costmap", param_hint=name)
    for name, is_given in {"--rooms": bool(rooms), "--doors": bool(doors_to_visit)}.items():
        if is_given and not plan:
            raise typer.BadParameter("only with --plan", param_hint=name)
    if scaling is not None and not door_inflate:
        raise typer.BadParameter("only with --door-inflate", param_hint="--scaling")
    costs = CostmapOptions(by=by.value, door_inflate_m=door_inflate,
                           scaling=10.0 if scaling is None else scaling)  # fmt: skip
    if save_root is not None and not save_root.is_dir():
        raise typer.BadParameter(
            f"expected a folder that is there, got {save_root}", param_hint="--save-root"
        )
    with stopped_for_good():
        log = _chosen_log(log, log_option, yaml, tz, read_only=read_only)
    stopping, wake = threading.Event(), threading.Event()
    on_stop(stopping.set)
    changes: list[Callable[[], object]] = [wake.set]

    def changed() -> None:
        for tell in changes:
            tell()

    shipping = writing_options.with_shipping(log, ship)
    if read_only and sign_key is not None:
        raise typer.BadParameter("signs what it writes, so not with --read-only",
                                 param_hint="--sign-key")  # fmt: skip
    signer = writing_options.signer_of(log, sign_key, sign_every, adopt=adopt)
    signing = writing_options.with_signing(log, signer)
    doors: DoorServer | DoorFollower
    if read_only:
        if not (yaml is save_root is None):
            raise typer.BadParameter(
                "nothing is written with --read-only", param_hint="--yaml, --save-root"
            )
        if ship is not None:
            raise typer.BadParameter("ships what it writes, so not with --read-only",
                                     param_hint="--ship")  # fmt: skip
        with stopped_for_good():
            poll_s = ASK_POLL_S if planners else POLL_S
            doors = DoorFollower(log, changed=changed, poll_s=poll_s)
    else:
        root = save_root or (None if yaml is None else yaml.absolute().parent)
        saver = DoorSaver(root, log, default_prob=default_prob)
        with stopped_for_good():
            doors = DoorServer(
                lambda: append(
                    log,
                    durability=durability.value,
                    batch_events=batch_events,
                    batch_s=batch_ms / 1000,
                    signer=signer,
                ),
                saver,
                level=level,
                changed=changed,
            )
        if is_in_ros:
            say(saver.told())
    with shipping, signing, closing(doors):
        with stopped_for_good():
            if yaml is not None and not isinstance(doors, DoorFollower):
                for text in start_with_yaml(
                    doors.log, yaml, replace=yaml_replace, level=level, default_prob=default_prob
                ):
                    say(text)
            floors = _floors(doors.door_map(), floor_map, map_rules, level)
        wish = PatrolWish(tuple(listed(rooms or ())), tuple(listed(doors_to_visit or ())))
        options = ServeOptions(
            costmap, floors, palette.colours, default_prob, costs, wish if plan else None
        )
        with ExitStack() as running:
            failure: Callable[[], Exception | None] = _no_failure
            if planners is not None:
                failure = running.enter_context(planners.served(log, doors, changes))
            if version is None:
                while failure() is None and not stopping.wait(TICK_S):
                    pass
            else:
                node = open_node(context, version, NODE)
                running.callback(node.close)
                many = counted(len(doors.door_map()), "door")
                Server(node, doors, wake, options).run(
                    lambda: stopping.is_set() or failure() is not None,
                    lambda: say(f"{node.name} serves {log}: {many}."),
                )
            if (failed := failure()) is not None:
                raise failed
    say(f"{log}: closed.")


def _no_failure() -> None:
    """Return why nobody can be answered any more, where no planner asks: never."""


def _chosen_log(
    log: Path | None, log_option: Path | None, yaml: Path | None, tz: str | None, *, read_only: bool
) -> Path:
    """Return the log to serve; --log's is made if it is not there.

    Raises:
        typer.BadParameter: Both are given, or none is.
        FormatError: The file that is to fill it cannot be read: nothing is made.
        OutputError: It cannot be made.
    """
    from semmap_log.interop.formats.files.thesis_yaml import read_thesis_yaml

    if (log is None) == (log_option is None):
        raise typer.BadParameter("give the log: LOG, or --log LOG", param_hint="LOG")
    if log is not None:
        if tz is not None:
            raise typer.BadParameter("only with --log: LOG has its zone", param_hint="--tz")
        return log
    assert log_option is not None
    if not (read_only or log_option.exists()):
        if yaml is not None:
            read_thesis_yaml(yaml)
        make_log(log_option, tz=tz)
    return log_option


def _floors(
    doors: DoorMap, floor_map: Path | None, rules: MapServer, level: str | None
) -> dict[int, FloorMap]:
    """Return the floor plan that was given, by its level.

    Raises:
        UnknownLevelError: The level is not there: better now than when a door is added.
    """
    from semmap_log.core.folds.levels import resolve_level
    from semmap_log.interop.formats.files.map_server import read_map

    if level is None and floor_map is None:
        return {}
    number = resolve_level(level, doors)
    return (
        {} if floor_map is None else {number: read_map(floor_map, level=number, rules=rules.value)}
    )
