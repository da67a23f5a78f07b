"""What the verbs share that read ROS messages: the mapping's option, its help, the dry run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import say
from semmap_log.cli.plain_streams import json_text
from semmap_log.common.texts import counted

if TYPE_CHECKING:
    from semmap_log.importing.import_plan import ImportPlan

MappingFile = Annotated[
    Path | None,
    typer.Option(
        "--mapping", metavar="YAML", help="Which ROS topics are read, and how; see above."
    ),
]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="ROS: print the events, a JSON line each; write nothing.")
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
      repeats: 60                      s; sightings of the same are left out
    Every key, with examples: semmap_log/ros_mapping/README.md
"""


def tell_plan(file: Path, plan: ImportPlan) -> None:
    """Print a plan's events, a JSON line each, and say what else there is to it."""
    from semmap_log.batches.event_batch import one_by_one
    from semmap_log.common.texts import told_once
    from semmap_log.formats.json.event_json import event_to_json

    for event in one_by_one(plan.events):
        typer.echo(json_text(event_to_json(event)))
    say(f"{file}: {counted(plan.count, 'event')}; nothing was written.")
    for text in plan.summary:
        say(f"  {text}")
    for text in told_once(plan.left_out):
        say(f"  left out: {text}")
    for text in told_once(plan.warnings):
        say(f"  warning: {text}")
