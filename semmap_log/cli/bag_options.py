"""Options of verbs that read bags and lasers, and what they print of what was found."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import (
    say,
)
from semmap_log.cli.sanitized_streams import json_text
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from collections.abc import Iterable

    from semmap_log.core.batches.event_batch import EventBatch
    from semmap_log.core.model.commits import Note
    from semmap_log.core.model.events import Event
    from semmap_log.interop.importing.import_plan import ImportPlan
    from semmap_log.interop.importing.scan_topics import ScanImport


MappingFile = Annotated[
    Path | None,
    typer.Option(
        "--mapping", metavar="YAML", help="Which ROS topics are read, and how; see above."
    ),
]


DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Print the events, a JSON line each; write nothing.")
]


Scan = Annotated[
    list[str] | None,
    typer.Option(
        "--scan",
        metavar="[TOPIC]",
        help="ROS: see the doors by a laser; a PointCloud2 has to be named. Repeatable.",
    ),
]


PoseTopic = Annotated[
    str | None,
    typer.Option(
        "--pose-topic",
        metavar="TOPIC",
        help="With --scan: the robot's poses on the map, instead of TF from map.",
    ),
]


Heights = Annotated[
    str | None,
    typer.Option(
        "--heights",
        metavar="LOW,HIGH",
        help="With --scan: of a PointCloud2 these heights over the robot's frame, m; 0.3,1.5.",
    ),
]


RobotLevel = Annotated[
    str | None,
    typer.Option("--level", help="ROS: where the robot drives; needed if there are several."),
]


KeepScans = Annotated[
    bool,
    typer.Option(
        "--keep-scans",
        help="With --scan: keep the scans of visits in LOG.scans, for `view` and `scan-report`.",
    ),
]


ClickedPoints = Annotated[
    bool,
    typer.Option(
        "--clicked-points",
        help="ROS: two clicks of RViz's Publish Point are a door: its hinge, then its other end.",
    ),
]


MAPPING_HELP = """\
    \b
    ROS topics without --mapping: all lta_semantic_map/DoorMap,
    rmf_door_msgs/DoorState and DoorRequest; poses on /amcl_pose, /robot_pose,
    /semmap/robot_pose; /map, /map/level_N.

    \b
    A mapping file names topics, and says how each is read:
      topics:
        /door_db: door_map             a server's: differences become events
        /door_states: rmf_door_state   Open-RMF; also rmf_door_request
        /amcl_pose: pose               or tf (topics /tf and /tf_static)
        /map: floor_map
        /follow_waypoints/_action/status: patrol
        /front/contact:
          {read: sensor, door: front, states: {open: true, closed: false}}
        /scan: scan                    a laser: what it sees of the doors
        /clicked_point: clicked_points two clicks in RViz are a door
      repeats: 60                      s; sightings of the same are left out
    Every key, with examples: semmap_log/interop/topics/README.md
"""


def check_scan(scan: list[str] | None, pose_topic: str | None, heights: str | None) -> None:
    """Refuse options about lasers where there are none."""
    for option, given in (("--pose-topic", pose_topic), ("--heights", heights)):
        if given is not None and scan is None:
            raise typer.BadParameter("is for lasers: give --scan, too", param_hint=option)


def heights_of(text: str | None) -> tuple[float, float] | None:
    """Return a band of heights, as the command line has it; None: it was not given."""
    if text is None:
        return None
    try:
        low, high = map(float, text.split(","))
    except ValueError:
        low = high = math.nan
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise typer.BadParameter(
            f"expected two heights in metres, the lower first, as 0.3,1.5; got {text!r}",
            param_hint="--heights",
        )
    return low, high


def check_keep_scans(*, keep_scans: bool, dry_run: bool) -> None:
    """Refuse to keep what only is looked at."""
    if keep_scans and dry_run:
        raise typer.BadParameter("--dry-run writes nothing", param_hint="--keep-scans")


def print_scan_import(file: Path, found: ScanImport) -> None:
    """Print the events that a bag would bring, those of visits with their notes."""
    from semmap_log.interop.importing.import_plan import ImportPlan

    for plan in (found.topics, found.earlier):
        show_events(plan.events)
    for visit in found.scans.visits:
        show_events(visit.commit.events, visit.commit.note)
    seen = sum(len(visit.commit.events) for visit in found.scans.visits)
    count = found.topics.count + found.earlier.count + seen
    print_plan(
        file,
        ImportPlan((), count, found.summary, found.left_out, found.warnings),
    )


def show_events(events: Iterable[Event | EventBatch], note: Note | None = None) -> None:
    """Print events, a JSON line each, with who saw them where that is known."""
    from semmap_log.core.batches.event_batch import one_by_one
    from semmap_log.interop.formats.json.door_json import event_to_json

    said = {"actor": note.actor, "source": note.source, "reason": note.reason} if note else None
    for event in one_by_one(events):
        typer.echo(json_text(event_to_json(event, note=said)))


def print_plan(file: Path, plan: ImportPlan) -> None:
    """Print a plan's events, a JSON line each, and say what else there is to it."""
    from semmap_log.core.texts import deduplicated

    show_events(plan.events)
    say(f"{file}: {counted(plan.count, 'event')}; nothing was written.")
    for text in plan.summary:
        say(f"  {text}")
    for text in deduplicated(plan.left_out):
        say(f"  left out: {text}")
    for text in deduplicated(plan.warnings):
        say(f"  warning: {text}")
